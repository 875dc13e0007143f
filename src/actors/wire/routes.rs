//! The table of routes: the node that serves a service or an action, and that subscribes to or publishes a topic.
//!
//! **Invariant:** arguments are read here or aside, never on the thread of the node.

use std::collections::HashMap;

use actix::prelude::*;

use super::action_client::ActionRequest;
use super::caller::{ServiceCall, TopicMessage};
use super::served::{AnswerForm, ClientAsker};
use crate::actors::node::{Call, Interest, Reply};
use crate::actors::resources::aside::{WorkKind, aside};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::services::{Answered, Callable, Streamed};

/// Longer arguments are read on another thread. Numbers near the middle between two doubles take 5 µs per 24 bytes, so
/// this length takes at most a fifth of a millisecond. Only computations, paths and lists of parameters accept longer
/// ones.
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
    /// Adds a row to a node's table: calls of `service` are this question.
    pub fn serve<A: Answered>(&mut self, service: Service, node: impl Into<Recipient<Call<A>>>) {
        self.route(service, node.into(), || AnswerForm::Short(A::write));
    }

    /// The same for a service with a possibly long answer.
    pub fn serve_long<A: Streamed>(
        &mut self,
        service: Service,
        node: impl Into<Recipient<Call<A>>>,
    ) {
        self.route(service, node.into(), || AnswerForm::Long(A::begin));
    }

    /// Reads the question, or returns its rejected fields.
    fn route<A: Callable>(
        &mut self,
        service: Service,
        node: Recipient<Call<A>>,
        form: fn() -> AnswerForm<A::Answer>,
    ) {
        let take = move |call: ServiceCall| {
            let node = node.clone();
            let length = call.arguments.payload().get().len();
            let read = move || {
                let mut caller = call.caller;
                match A::read(call.service, &call.arguments) {
                    Ok(ask) => {
                        let done = caller.done.take();
                        let form = form();
                        let reply = Reply::new(ClientAsker { caller, form }, done);
                        node.do_send(Call { ask, reply });
                    }
                    Err(rejections) => caller.refuse(&rejections.status()),
                }
            };
            read_arguments(length, read);
        };
        self.services.insert(service, Box::new(take));
    }
}

/// Reads arguments of `length` bytes. Long ones are read on another thread, while the client's next frames wait.
pub(in crate::actors) fn read_arguments(length: usize, read: impl FnOnce() + Send + 'static) {
    if length > LONG_ARGUMENTS {
        // The task is boxed, so only one kind is compiled, and not one for each service.
        let read: Box<dyn FnOnce() + Send> = Box::new(read);
        actix_rt::spawn(aside(WorkKind::of(length), read));
    } else {
        read();
    }
}
