//! The messages of the nodes: questions with one answer, messages on topics, interest, goals. And the way of a client's
//! call or goal to its node and back.
//!
//! A service is a question, [`Ask`], and a node serves it by a handler for [`Call`] of that question. The asker,
//! a client or another node, is behind the [`Reply`].
//!
//! A question that clients can send defines its reader and the writer of its answer ([`Callable`], [`Answered`]). The
//! table of routes ([`Nodes`]) defines the node. All errors on the way are handled here: invalid arguments, a dropped
//! question, and the form of an error.
//!
//! **Invariant:** every [`Call`] is answered exactly once, even if its node fails: a [`Reply`] or a [`Caller`] that is
//! dropped unanswered sends an error. A node parses no JSON. Arguments are read before a node gets the call, never on the
//! arm's thread, and its answer is written on the thread that answers. Feedback of a goal may be dropped for a slow
//! client. The end of a goal is never dropped, and follows all feedback.

use std::collections::HashMap;
use std::fmt::Display;
use std::future::ready;
use std::pin::Pin;
use std::sync::{Arc, Weak};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;
use tokio::time::timeout;

use crate::actors::ConnectionId;
use crate::actors::resources::gone::Gone;
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::{Memory, PERMIT_TIME, Permit, SHORT, cover};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::fields::Rejections;
use crate::protocol::op::{Arguments, GoalStatus};
use crate::protocol::ros::rosapi::Census;
use crate::protocol::wire::json::Payload;
pub use crate::services::{Address, Answered, Ask, Callable};

// ---- questions ------------------------------------------------------------------------------------------------------

/// A question for the node that serves it, answered through `reply`.
///
/// actix's own answers have a separate path. A client's answer must follow the messages that the node has published
/// before, so it takes their path through the registry.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Call<A: Ask> {
    /// The question.
    pub ask: A,
    /// The way back.
    pub reply: Reply<A::Answer>,
}

/// The end, with its reason: waiting calls are refused, goals aborted. From the runtime, once the registry forwards
/// nothing more.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct ShutDown(pub &'static str);

/// Why a question has no answer. It has had no effect, and will have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Unserved(pub &'static str);

impl Unserved {
    /// The node dropped the question.
    pub const ENDED: Self = Self("the node that serves this ended before it answered");
    /// The arm has ended.
    pub const NO_ARM: Self = Self("arm_sim does not answer");
    /// The caller has disconnected.
    pub const CALLER_GONE: Self = Self("the caller is gone");
    /// Other answers have used the memory for too long.
    pub const NO_MEMORY: Self = Self("other long answers use the memory; call again later");
}

/// A guard of an op that has not yet taken effect: a call, a goal, a message for a node, or a long
/// message that is being encoded. The connection reads the client's next frame once the last clone is dropped.
pub type Done = Arc<oneshot::Sender<()>>;

/// A guard, and a receiver that ends with its last clone.
#[must_use]
pub fn guard() -> (Done, oneshot::Receiver<()>) {
    let (done, ended) = oneshot::channel();
    (Arc::new(done), ended)
}

/// The asker.
pub trait Asker<T>: Send {
    /// Writes and sends the one answer. The guard of the call, if there is one, is sent with it.
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, done: Option<Done>);

    /// Whether the caller has disconnected.
    fn is_gone(&self) -> bool {
        false
    }

    /// The same, and asks the system, which takes some microseconds.
    fn has_left(&self) -> bool {
        self.is_gone()
    }

    /// Sends, before the answer, the reason why the request has no effect yet. For a node this is in the answer.
    fn warn(&self, _why: &str) {}

    /// Waits for memory for an answer of at most `bytes` bytes, before it is computed.
    fn reserve(&mut self, _bytes: usize) -> Reserving<'_> {
        Box::pin(ready(Ok(())))
    }
}

/// A wait for memory. It ends with an error if the caller has disconnected, or if it takes too long.
pub type Reserving<'a> = Pin<Box<dyn Future<Output = Result<(), Unserved>> + 'a>>;

/// The way back to the caller: one answer, then the end of the call.
///
/// The client's next frame is read only after this value is dropped. So effects after the answer (a goal's
/// setpoint) precede the client's next request.
pub struct Reply<T> {
    /// `None` once the answer has been sent.
    asker: Option<Box<dyn Asker<T>>>,
    done: Option<Done>,
}

impl<T> Reply<T> {
    /// A reply to `asker`. `done` is dropped with it.
    #[must_use]
    pub fn new(asker: impl Asker<T> + 'static, done: Option<Done>) -> Self {
        Self {
            asker: Some(Box::new(asker)),
            done,
        }
    }

    /// Whether the caller has disconnected.
    #[must_use]
    pub fn caller_is_gone(&self) -> bool {
        self.asker.as_ref().is_some_and(|asker| asker.is_gone())
    }

    /// The same, and asks the system, which takes some microseconds.
    #[must_use]
    pub fn caller_has_left(&self) -> bool {
        self.asker.as_ref().is_some_and(|asker| asker.has_left())
    }

    /// Waits for memory for an answer of at most `bytes` bytes, before it is computed. Short answers need none. Refuses
    /// the call and returns `false` if there is none.
    pub async fn reserve(&mut self, bytes: usize) -> bool {
        let reserved = match &mut self.asker {
            Some(asker) => asker.reserve(bytes).await,
            None => Ok(()),
        };
        reserved.map_err(|why| self.refuse(why)).is_ok()
    }

    /// Sends a client a status, before the answer, with the reason why the request has no effect yet.
    pub fn warn(&self, why: &str) {
        if let Some(asker) = &self.asker {
            asker.warn(why);
        }
    }

    /// Answers and ends the call, after all its effects. One message has both.
    pub fn conclude(mut self, answer: T) {
        let done = self.done.take();
        self.send(Ok(answer), done);
    }

    /// Answers. The call ends when this value is dropped.
    pub fn answer(&mut self, answer: T) {
        self.send(Ok(answer), None);
    }

    /// Sends the error that there is no answer.
    pub fn refuse(&mut self, why: Unserved) {
        self.send(Err(why), None);
    }

    fn send(&mut self, answer: Result<T, Unserved>, done: Option<Done>) {
        debug_assert!(self.asker.is_some(), "a call was answered twice");
        if let Some(asker) = self.asker.take() {
            asker.answer(answer, done);
        }
    }
}

impl<T> Drop for Reply<T> {
    fn drop(&mut self) {
        if self.asker.is_some() {
            self.refuse(Unserved::ENDED);
        }
    }
}

impl<T: Send> Asker<T> for oneshot::Sender<Result<T, Unserved>> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        // The caller may have disconnected.
        let _ = self.send(answer);
    }

    fn is_gone(&self) -> bool {
        self.is_closed()
    }
}

/// Sends a question to another node.
///
/// # Errors
/// If it does not answer.
pub fn ask<A: Ask>(
    node: &Recipient<Call<A>>,
    ask: A,
) -> impl Future<Output = Result<A::Answer, Unserved>> + Send + use<A> {
    let (answered, answer) = oneshot::channel();
    let reply = Reply::new(answered, None);
    node.do_send(Call { ask, reply });
    async move { answer.await.unwrap_or(Err(Unserved::ENDED)) }
}

// ---- between the registry and the nodes -----------------------------------------------------------------------------

/// Whether a topic of the node has subscribers. From the registry, at every change.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Interest {
    /// The topic.
    pub topic: Topic,
    /// True while there is a subscriber.
    pub wanted: bool,
}

/// Writes a published frame. The registry calls it, so the arm's thread does not have to write.
pub type FrameOut = Box<dyn FnOnce() -> Bytes + Send>;

/// A message on a topic. From the node that owns it.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Publish {
    /// The topic.
    pub topic: Topic,
    /// The whole `publish` frame, encoded once.
    pub frame: FrameOut,
}

impl Publish {
    /// The message of `make`, which the registry calls and encodes.
    #[must_use]
    pub fn made<M: Serialize>(topic: Topic, make: impl FnOnce() -> M + Send + 'static) -> Self {
        let frame = Box::new(move || messages::publish(topic.name(), &make()));
        Self { topic, frame }
    }
}

/// A frame for one client. From a node, or from the route to it if the arguments are rejected.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Respond {
    /// The client.
    pub connection: ConnectionId,
    /// The whole frame.
    pub frame: Bytes,
    /// Its kind.
    pub kind: FrameKind,
    /// Dropped once the frame is sent, if that is also the end of the call.
    pub done: Option<Done>,
}

/// The kinds of frames for one client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// The answer of one of the runtime's services.
    Answer(Service),
    /// The end of a goal, or the refusal of a call or goal that could not be read.
    End,
    /// A status. It is sent only to clients that selected this level.
    Status(Level),
    /// Feedback of a goal. It may be dropped for a slow client.
    Feedback,
}

/// A client, and the way back to it.
#[derive(Clone)]
pub struct ClientLink {
    /// The way back.
    pub registry: Recipient<Respond>,
    /// The connection.
    pub connection: ConnectionId,
    /// Set when the client has disconnected.
    pub gone: Gone,
}

impl ClientLink {
    /// Whether the client has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.is_set()
    }

    /// Sends a status with the reason why the frame with this `id` has no effect, or none yet.
    pub fn status(&self, level: Level, why: &str, id: Option<&Payload>) {
        let frame = messages::status(level, why, id);
        self.send(FrameKind::Status(level), frame, None);
    }

    /// Sends a frame. `done` is dropped once it is sent.
    pub fn send(&self, kind: FrameKind, frame: Bytes, done: Option<Done>) {
        self.registry.do_send(Respond {
            connection: self.connection,
            frame,
            kind,
            done,
        });
    }
}

/// A barrier in the mailbox of an actor that informs clients of goals, which answers it after all earlier messages.
/// From the arm, before it reports that it is at rest and between steps on request, and from `ik_trial`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Barrier;

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
    pub subscribers: HashMap<Topic, Route<TopicMessage>>,
    /// The node that publishes each of the runtime's topics.
    pub publishers: HashMap<Topic, Recipient<Interest>>,
}

impl Nodes {
    /// The node serves `service`: it gets each call as this question. The arguments are read here, and rejected ones
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
    pub fn serve_action<G: Goal, A>(&mut self, node: Addr<A>)
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
    /// The room that is taken for the long frame that asked.
    permit: Option<Permit>,
    /// The room that is taken for a long answer.
    room: Option<Permit>,
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
            room: None,
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

    /// Waits for memory for an answer of at most `bytes` bytes, besides the echo of the caller's `id`, before it is
    /// computed. A caller whose frame has a permit waits for at most [`PERMIT_TIME`].
    ///
    /// # Errors
    /// If the caller has disconnected, or has waited for too long.
    pub async fn reserve(&mut self, bytes: usize) -> Result<(), Unserved> {
        let id = self.id().map_or(0, |id| id.get().len());
        let bytes = bytes.saturating_add(id);
        // Two callers that kept a part each, and waited for more, could wait for each other.
        self.room = None;
        if bytes > SHORT {
            let limit = self.permit.as_ref().map_or(Duration::MAX, |_| PERMIT_TIME);
            let room = timeout(limit, self.memory.answer(bytes));
            tokio::select! {
                biased;
                room = room => self.room = Some(room.map_err(|_| Unserved::NO_MEMORY)?),
                () = self.link.gone.wait() => {}
            }
        }
        if self.is_gone() {
            return Err(Unserved::CALLER_GONE);
        }
        Ok(())
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
            let permit = self.room.as_ref().or(self.permit.as_ref());
            let frame = cover(permit, write(&address));
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

    fn has_left(&self) -> bool {
        self.caller.link.gone.look()
    }

    fn warn(&self, why: &str) {
        let id = self.caller.id();
        self.caller.link.status(Level::Warning, why, id);
    }

    fn reserve(&mut self, bytes: usize) -> Reserving<'_> {
        Box::pin(self.caller.reserve(bytes))
    }
}

// ---- goals of an action ---------------------------------------------------------------------------------------------

/// A client's goal or cancellation, forwarded by the registry.
pub enum ActionRequest {
    /// A goal whose fields are not parsed yet.
    Goal(ForwardGoal<Arguments>),
    /// A cancellation.
    Cancel(CancelSent),
}

/// A goal that clients send by an action.
pub trait Goal: Sized + Send + 'static {
    /// The action.
    const ACTION: Action;

    /// Reads a goal.
    ///
    /// # Errors
    /// All rejected fields, by name.
    fn read(arguments: &Arguments) -> Result<Self, Rejections>;
}

/// A goal with its client. From clients, by the action.
#[derive(Message)]
#[rtype(result = "()")]
pub struct ForwardGoal<G> {
    /// The goal.
    pub goal: G,
    /// The client that sent it.
    pub client: ActionClient,
    /// Dropped when the goal has started or is refused. The client's next frame is read then.
    pub done: Done,
}

/// Cancels the goal that the same client has sent under this id, or all goals of the action. From clients, by the action.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CancelSent {
    /// The client. It gets an error status if the goal is not active.
    pub link: ClientLink,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether all goals are cancelled, also those of other clients.
    pub all: bool,
    /// Dropped when the goal has ended.
    pub done: Done,
}

/// The client that sent a goal.
pub struct ActionClient {
    /// The client.
    pub link: ClientLink,
    /// The action's name as the client spells it.
    pub action: Arc<str>,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether the client gets feedback.
    pub wants_feedback: bool,
}

impl CancelSent {
    /// Whether it is about the goal of this client.
    #[must_use]
    pub fn is_of(&self, client: &ActionClient) -> bool {
        self.all || (self.link.connection == client.link.connection && self.id == client.id)
    }

    /// Sends the reason why the goal was not cancelled.
    pub fn refuse(&self, why: &str) {
        if !self.all {
            self.link.status(Level::Error, why, self.id.as_ref());
        }
    }
}

impl ActionClient {
    /// Sends a status with the reason why the goal has no effect yet.
    pub fn warn(&self, why: &str) {
        self.link.status(Level::Warning, why, self.id.as_ref());
    }

    /// Sends feedback, if the client gets it.
    pub fn feed_back(&self, values: impl Serialize) {
        if self.wants_feedback {
            let frame = messages::action_feedback(&self.action, self.id.as_ref(), &values);
            self.link.send(FrameKind::Feedback, frame, None);
        }
    }

    /// Sends the result of the goal.
    pub fn conclude(&self, values: impl Serialize, status: GoalStatus) {
        self.end(values, status, true);
    }

    /// Sends the reason why the goal has no result. In this case clients expect a text in `values`.
    pub fn fail(&self, why: &str, status: GoalStatus) {
        self.end(why, status, false);
    }

    /// Sends the reason why the goal was not accepted.
    pub fn refuse(&self, why: &str) {
        self.fail(why, GoalStatus::Unknown);
    }

    fn end(&self, values: impl Serialize, status: GoalStatus, result: bool) {
        let (action, id) = (&self.action, self.id.as_ref());
        let frame = messages::action_result(action, id, &values, status as u8, result);
        self.link.send(FrameKind::End, frame, None);
    }
}

// ---- to the registry, from the runtime, rosapi and the recorder -----------------------------------------------------

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);

/// Requests the topics and services of the clients. From `rosapi`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Census")]
pub struct TakeCensus;

/// A message or call in the registry, as the tap gets it.
pub enum Tapped<'a> {
    /// A message on a topic of the runtime, from a node or a client, as the whole `publish` frame.
    Published(Topic, &'a Bytes),
    /// A client's call of one of the runtime's services.
    Called {
        /// The client.
        from: ConnectionId,
        /// The service.
        service: Service,
        /// The caller's `id`, if there is one.
        id: Option<&'a Payload>,
        /// The arguments.
        args: &'a Payload,
    },
    /// The response to such a call, as the whole frame.
    Answered {
        /// The client.
        to: ConnectionId,
        /// The service.
        service: Service,
        /// The frame.
        frame: &'a Bytes,
    },
}

/// Gets every message and call of the runtime, on the registry's thread. It must not block.
pub type Tap = Box<dyn FnMut(Tapped<'_>) + Send>;

/// Sets or removes the tap. While a tap is set, every topic of the runtime counts as subscribed. From the recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetTap(pub Option<Tap>);

/// The registry rejects new calls, and the calls and goals that wait for clients, with this reason. From the runtime,
/// when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct RefuseCalls(pub &'static str);

/// Every connection sends its queue and ends. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct FinishAll;
