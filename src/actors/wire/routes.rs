//! The table of routes: the node that serves a service or an action, and that subscribes to or publishes a topic.
//!
//! **Invariant:** arguments are read here or aside, never on the thread of the node.

use std::collections::HashMap;

use actix::prelude::*;

use super::action_client::{ActionRequest, CancelSent, Goal, Pursue};
use super::caller::{ClientAsker, ServiceCall, TopicMessage};
use crate::actors::node::{Call, Interest, Reply};
use crate::actors::resources::aside::{WorkKind, aside};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::services::Answered;

/// Arguments longer than this are read aside. Numbers near the middle between two doubles take 5 µs for each 24 bytes,
/// so these take a fifth of a millisecond. Usual ones are shorter.
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
    pub listeners: HashMap<Topic, Route<TopicMessage>>,
    /// The node that publishes each of the runtime's topics.
    pub publishers: HashMap<Topic, Recipient<Interest>>,
}

impl Nodes {
    /// A row of a node's table: calls of `service` are this question. Its fields are read here, and the rejected ones
    /// are reported.
    pub fn serve<A: Answered>(&mut self, service: Service, node: impl Into<Recipient<Call<A>>>) {
        let node = node.into();
        let take = move |call: ServiceCall| {
            let node = node.clone();
            let length = call.arguments.payload().get().len();
            let read = move || {
                let mut caller = call.caller;
                match A::read(call.service, &call.arguments) {
                    Ok(ask) => {
                        let done = caller.done.take();
                        let asker = ClientAsker {
                            caller,
                            write: A::write,
                        };
                        let reply = Reply::new(asker, done);
                        node.do_send(Call { ask, reply });
                    }
                    Err(rejections) => caller.refuse(&rejections.status()),
                }
            };
            read_arguments(length, read);
        };
        self.services.insert(service, Box::new(take));
    }

    /// Messages of clients on `topic` are read by `take`.
    pub fn listen(&mut self, topic: Topic, take: impl Fn(TopicMessage) + Clone + Send + 'static) {
        let take = move |message: TopicMessage| {
            let take = take.clone();
            read_arguments(message.msg.get().len(), move || take(message));
        };
        self.listeners.insert(topic, Box::new(take));
    }

    /// Goals of this kind, and their cancellations, are for this node.
    pub fn carry_out<G: Goal, A>(&mut self, node: Addr<A>)
    where
        A: Actor<Context = Context<A>> + Handler<Pursue<G>> + Handler<CancelSent>,
    {
        let take = move |request| match request {
            ActionRequest::Goal(Pursue { goal, client, done }) => {
                let node = node.clone();
                let length = goal.payload().get().len();
                let read = move || match G::read(&goal) {
                    Ok(goal) => node.do_send(Pursue { goal, client, done }),
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
        actix_rt::spawn(aside(WorkKind::of(length), read));
    } else {
        read();
    }
}
