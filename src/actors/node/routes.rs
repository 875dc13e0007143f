//! The table of routes: the node of each service, action and topic.
//!
//! **Invariant:** arguments are read before a node gets the call, never on the arm's thread. Rejected ones are reported.

use std::collections::HashMap;
use std::fmt::Display;

use actix::prelude::*;

use super::callers::{ServiceCall, TopicMessage};
use super::goals::{ActionRequest, CancelSent, ForwardGoal, SentGoal};
use super::questions::{Call, Reply};
use super::registry::Interest;
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::wire::json::Payload;
use crate::services::Ask;

/// Arguments longer than this are read on a worker thread. Numbers near the middle between two doubles take 5 µs for
/// each 24 bytes, so these take a fifth of a millisecond. Usual ones are shorter.
const LONG_ARGUMENTS: usize = 1024;

/// Passes a message to its node.
pub type Route<T> = Box<dyn Fn(T) + Send>;

/// The runtime's own nodes, by the services, topics and actions that they serve.
#[derive(Default)]
pub struct Nodes {
    /// Passes a call to the node that answers it.
    pub services: HashMap<Service, Route<ServiceCall>>,
    /// Passes a goal to the node that serves its action.
    pub actions: HashMap<Action, Route<ActionRequest>>,
    /// Passes a message to the node that subscribes to its topic.
    pub subscribers: HashMap<Topic, Route<TopicMessage>>,
    /// The node that publishes each of the runtime's topics.
    pub publishers: HashMap<Topic, Recipient<Interest>>,
}

impl Nodes {
    /// The node serves `service`: it gets each call as this question. The arguments are read here, and rejected ones
    /// are reported.
    pub fn serve<A: Ask>(&mut self, service: Service, node: impl Into<Recipient<Call<A>>>) {
        let node = node.into();
        let take = move |call: ServiceCall| {
            let node = node.clone();
            let length = call.arguments.get().len();
            let read = move || {
                let mut caller = call.caller;
                match A::read(call.service, &call.arguments) {
                    Ok(ask) => {
                        let reply = Reply::to_client(caller, A::write);
                        node.do_send(Call { ask, reply });
                    }
                    Err(rejections) => caller.refuse(&rejections.status()),
                }
            };
            read_arguments(length, read);
        };
        self.services.insert(service, Box::new(take));
    }

    /// The node subscribes to `topic`: `read` reads a client's message, and `to_node` makes the node's own message of it.
    pub fn subscribe<T: 'static, E: Display + 'static, M: Message<Result = ()> + Send + 'static>(
        &mut self,
        topic: Topic,
        node: impl Into<Recipient<M>>,
        read: fn(&Payload) -> Result<T, E>,
        to_node: fn(T, TopicMessage) -> M,
    ) {
        let node = node.into();
        let take = move |message: TopicMessage| {
            let node = node.clone();
            let length = message.msg.get().len();
            read_arguments(length, move || match read(&message.msg) {
                Ok(content) => node.do_send(to_node(content, message)),
                Err(why) => message.refuse(topic, &why),
            });
        };
        self.subscribers.insert(topic, Box::new(take));
    }

    /// The node serves the action of these goals: it gets goals and cancellations.
    pub fn serve_action<G: SentGoal, A>(&mut self, node: Addr<A>)
    where
        A: Actor<Context = Context<A>> + Handler<ForwardGoal<G>> + Handler<CancelSent>,
    {
        let take = move |request| match request {
            ActionRequest::Goal(ForwardGoal {
                goal,
                client,
                working,
            }) => {
                let node = node.clone();
                let length = goal.get().len();
                let read = move || match G::read(&goal) {
                    Ok(goal) => node.do_send(ForwardGoal {
                        goal,
                        client,
                        working,
                    }),
                    Err(rejections) => client.refuse(&rejections.status()),
                };
                read_arguments(length, read);
            }
            ActionRequest::Cancel(cancel) => node.do_send(cancel),
        };
        self.actions.insert(G::ACTION, Box::new(take));
    }
}

/// Reads arguments of `length` bytes: long ones on another thread, while the client's next frames wait.
fn read_arguments(length: usize, read: impl FnOnce() + Send + 'static) {
    if length > LONG_ARGUMENTS {
        // The task is boxed, so only one kind is compiled, and not one for each service.
        let read: Box<dyn FnOnce() + Send> = Box::new(read);
        actix_rt::spawn(run_long_work(WorkKind::of(length), read));
    } else {
        read();
    }
}

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);
