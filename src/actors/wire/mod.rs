//! Translation between the registry and the nodes: a client's call is read here as a question, and a node's answer
//! is written here as the call's one response.
//!
//! A question that clients can send defines its reader and the writer of its answer ([`Callable`]). The table of
//! routes ([`Nodes`]) defines the node. All errors on the way are handled here: invalid arguments, a dropped
//! question, and the form of an error.
//!
//! **Invariant:** a node sees no JSON. Arguments are read before a node gets the call, never on the node's thread. Its
//! answer is written here, on the thread that answers. Every call is answered once: a caller that is dropped
//! unanswered sends an error.

pub mod action_client;

use std::collections::HashMap;
use std::fmt::Display;
use std::sync::Weak;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;

use self::action_client::{ActionRequest, CancelSent, ForwardGoal, Goal};
use crate::actors::node::{
    Asker, Call, ClientLink, Done, FrameKind, Interest, Reply, Unserved, guard,
};
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::{Memory, Permit, SHORT, cover};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::messages::Level;
use crate::protocol::op::Arguments;
use crate::protocol::wire::json::Payload;
pub use crate::services::{Address, Answered, Callable};

// ---- the table of routes: the node of each service, action and topic ------------------------------------------------

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
            let length = call.arguments.get().len();
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

    /// Messages of clients on `topic` are read by `read`, and are for this node as `to_node` makes them.
    pub fn listen<T: 'static, E: Display + 'static, M: Message<Result = ()> + Send + 'static>(
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
        self.listeners.insert(topic, Box::new(take));
    }

    /// Goals of this kind, and their cancellations, are for this node.
    pub fn carry_out<G: Goal, A>(&mut self, node: Addr<A>)
    where
        A: Actor<Context = Context<A>> + Handler<ForwardGoal<G>> + Handler<CancelSent>,
    {
        let take = move |request| match request {
            ActionRequest::Goal(ForwardGoal { goal, client, done }) => {
                let node = node.clone();
                let length = goal.get().len();
                let read = move || match G::read(&goal) {
                    Ok(goal) => node.do_send(ForwardGoal { goal, client, done }),
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

// ---- a client's call, and the way back ------------------------------------------------------------------------------

/// A call of one of the runtime's own services, forwarded by the registry.
pub struct ServiceCall {
    /// The service that was called.
    pub service: Service,
    /// The caller's arguments, not parsed yet.
    pub arguments: Arguments,
    /// The way back.
    pub caller: Caller,
}

/// A client's message on a topic of the runtime, forwarded by the registry.
pub struct TopicMessage {
    /// The message.
    pub msg: Payload,
    /// The client.
    pub link: ClientLink,
    /// Ends with the client's connection, or when the client unsubscribes from the replies to its message.
    pub listening: Weak<()>,
    /// The frame's `id`, if it had one.
    pub id: Option<Payload>,
    /// Dropped when the message has taken effect. The connection reads its next frame then.
    pub done: Done,
}

impl TopicMessage {
    /// Sends the client an error status with the reason why the message is not valid for `topic`.
    pub fn refuse(&self, topic: Topic, why: &impl Display) {
        let why = format!("{}: {why}", topic.name());
        self.link.status(Level::Error, &why, self.id.as_ref());
    }
}

/// The calling client, and the way back to it. If it is dropped unanswered, it sends an error.
pub struct Caller {
    link: ClientLink,
    /// None once the answer has been given.
    address: Option<Address>,
    /// The room that is taken for a long answer, or else for the long frame that asked.
    permit: Option<Permit>,
    done: Option<Done>,
    /// The pools for long answers.
    memory: Memory,
}

impl Caller {
    /// The client that called the service of `address`. `memory` has the pools for long answers, and `permit` is that
    /// of the call's frame, if it was long. The receiver ends with the call.
    #[must_use]
    pub fn new(
        link: ClientLink,
        address: Address,
        memory: Memory,
        permit: Option<Permit>,
    ) -> (Self, oneshot::Receiver<()>) {
        let (done, ended) = guard();
        let caller = Self {
            link,
            address: Some(address),
            permit,
            done: Some(done),
            memory,
        };
        (caller, ended)
    }

    /// The caller's `id`, which the response echoes.
    #[must_use]
    pub fn id(&self) -> Option<&Payload> {
        self.address.as_ref()?.id()
    }

    /// Whether the caller has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.link.is_gone()
    }

    /// Reserves memory for an answer of at most `bytes` bytes, besides the echo of the caller's `id`, before it is
    /// computed. `false` while other answers use it. Short answers need no reservation.
    pub fn reserve(&mut self, bytes: usize) -> bool {
        let id = self.id().map_or(0, |id| id.get().len());
        let bytes = bytes.saturating_add(id);
        if bytes <= SHORT {
            return true;
        }
        let Some(permit) = self.memory.answer(bytes) else {
            return false;
        };
        self.permit = Some(permit);
        true
    }

    /// Answers `result: true`. The call ends when this value is dropped.
    pub fn succeed(&mut self, values: &impl Serialize) {
        self.answer(None, |address| address.response(values, ""));
    }

    /// Answers `result: false` with empty values, for the reason `why`.
    pub fn refuse(&mut self, why: &str) {
        self.answer(None, |address| address.failure(why));
    }

    /// Answers, unless that has been done.
    fn answer(&mut self, done: Option<Done>, write: impl FnOnce(&Address) -> Bytes) {
        if let Some(address) = self.address.take() {
            let frame = cover(self.permit.as_ref(), write(&address));
            let kind = FrameKind::Answer(address.service());
            self.link.send(kind, frame, done);
        }
    }
}

impl Drop for Caller {
    fn drop(&mut self) {
        self.refuse(&Unserved::ENDED.to_string());
    }
}

// ---- a caller that waits for a node's answer ------------------------------------------------------------------------

/// A client that has asked for a `T`.
struct ClientAsker<T> {
    caller: Caller,
    /// Writes the answer.
    write: fn(T, &Address) -> Bytes,
}

impl<T: Send + 'static> Asker<T> for ClientAsker<T> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, done: Option<Done>) {
        let Self { mut caller, write } = *self;
        caller.answer(done, |address| match answer {
            Ok(answer) => write(answer, address),
            Err(why) => address.failure(&why.to_string()),
        });
    }

    fn is_gone(&self) -> bool {
        self.caller.is_gone()
    }

    fn warn(&self, why: &str) {
        let id = self.caller.id();
        self.caller.link.status(Level::Warning, why, id);
    }

    fn reserve(&mut self, bytes: usize) -> bool {
        self.caller.reserve(bytes)
    }
}
