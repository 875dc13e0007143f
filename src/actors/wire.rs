//! Between the registry and the nodes: a client's call is read here and becomes a question, and a node's answer is
//! written here and becomes the call's one response.
//!
//! A question that clients can ask says how it is read and how its answer is written ([`Served`]); a node's table of
//! routes lists its questions. All that goes wrong on the way is in here, once: bad arguments, a question that was
//! dropped, and how an error is written.
//!
//! **Invariant:** arguments are read before a node hears of the call, and responses written after it has answered: a
//! node's thread sees no JSON.

use std::collections::HashMap;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;
use tokio::time::Instant;

use super::ConnectionId;
use super::node::{Ask, Asker, Call, Done, Frame, Interest, Pieces, Reply, Respond, Unserved};
use crate::actors::gateway::aside::{Errand, aside};
use crate::actors::gateway::budget::{Account, NoRoom, Promise};
use crate::actors::ros::follower::ActionRequest;
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::messages::{self, ErrorForm};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::protocol::wire::payload::Payload;

/// Bytes of an answer that is computed without asking for room first: more than any answer has but those that list or compute
/// something.
pub const SMALL_ANSWER: usize = 16 * 1024;
/// How long a computation waits for room that is taken by answers which wait for their clients, before it is refused.
pub const ROOM_TIME: Duration = Duration::from_secs(2);
/// Arguments longer than this are read aside: some tenth of a millisecond. Only computations take such.
pub(in crate::actors) const LONG_ARGUMENTS: usize = 16 * 1024;

// ---- calls ----------------------------------------------------------------------------------------------------------

/// A call of one of the runtime's own services, as the registry has it.
pub struct ServiceCall {
    /// Which service.
    pub service: Service,
    /// The caller's arguments, unread.
    pub arguments: Arguments,
    /// The way back.
    pub caller: Caller,
}

/// A client's message on a topic that the runtime subscribes to, as the registry has it.
pub struct TopicMessage {
    /// The message as it came.
    pub msg: Payload,
    /// The way back, for an error status.
    pub respond: Recipient<Respond>,
    /// The client.
    pub connection: ConnectionId,
    /// The frame's `id`, if it had one.
    pub id: Option<Payload>,
    /// Dropped when the message has taken effect: the connection reads its next frame then.
    pub done: Done,
}

/// Where a response goes, and what it has to say of the call.
pub struct Address {
    service: Service,
    name: Box<str>,
    id: Option<Payload>,
    /// How the caller is told why the call failed.
    error_form: ErrorForm,
    /// Counts what the caller makes the program hold: the answer, too, until it has been written.
    account: Option<Arc<Account>>,
    /// Room that was taken for an answer of megabytes.
    promise: Option<Promise>,
}

impl Address {
    /// The service's name as the caller spelled it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The caller's `id`, which the response echoes.
    #[must_use]
    pub fn id(&self) -> Option<&Payload> {
        self.id.as_ref()
    }

    /// The response with `values`; `result` is true if `status` is empty. Otherwise callers who want the text there get
    /// that in place of `values`.
    #[must_use]
    pub fn response(&self, values: &impl Serialize, status: &str) -> Bytes {
        let is_good = status.is_empty();
        if !is_good && self.error_form == ErrorForm::Text {
            return self.failure(status);
        }
        messages::response(&self.name, self.id.as_ref(), values, is_good, status)
    }

    /// The response `result: false` without values.
    #[must_use]
    pub fn failure(&self, why: &str) -> Bytes {
        messages::failure(&self.name, self.id.as_ref(), why, self.error_form)
    }

    /// The response with values, or with the reason why there are none.
    #[must_use]
    pub fn outcome<T: Serialize, E: ToString>(&self, outcome: Result<T, E>) -> Bytes {
        match outcome {
            Ok(values) => self.response(&values, ""),
            Err(why) => self.failure(&why.to_string()),
        }
    }

    /// The response, counted until it has been written to the client.
    fn counted(self, frame: Bytes) -> Bytes {
        match (self.promise, self.account) {
            (Some(promise), _) => promise.cover(frame),
            (None, Some(account)) => account.count(frame),
            (None, None) => frame,
        }
    }
}

/// The client that called, and the way back to it. Dropped unanswered, it says so.
pub struct Caller {
    registry: Recipient<Respond>,
    connection: ConnectionId,
    /// None once the answer has been given.
    address: Option<Address>,
    gone: Arc<AtomicBool>,
    done: Option<Done>,
    /// Since when answers that wait have left no room for one of megabytes.
    asked_for_room: Option<Instant>,
}

impl Caller {
    /// The client `connection`, which called `service`, spelled `name`; the receiver ends with the call.
    #[must_use]
    pub fn new(
        registry: Recipient<Respond>,
        connection: ConnectionId,
        service: Service,
        name: Box<str>,
        id: Option<Payload>,
        gone: Arc<AtomicBool>,
    ) -> (Self, oneshot::Receiver<()>) {
        let (done, ended) = oneshot::channel();
        let address = Address {
            service,
            name,
            id,
            error_form: ErrorForm::default(),
            account: None,
            promise: None,
        };
        let caller = Self {
            registry,
            connection,
            address: Some(address),
            gone,
            done: Some(done),
            asked_for_room: None,
        };
        (caller, ended)
    }

    /// The answer is charged to this account, the caller's, until it has been written.
    #[must_use]
    pub fn within(mut self, account: Arc<Account>) -> Self {
        if let Some(address) = &mut self.address {
            address.account = Some(account);
        }
        self
    }

    /// The caller is told in this form why the call failed.
    #[must_use]
    pub fn with_errors(mut self, form: ErrorForm) -> Self {
        if let Some(address) = &mut self.address {
            address.error_form = form;
        }
        self
    }

    /// The connection that called.
    #[must_use]
    pub fn connection(&self) -> ConnectionId {
        self.connection
    }

    /// The caller's `id`, which the response echoes.
    #[must_use]
    pub fn id(&self) -> Option<&Payload> {
        self.address.as_ref()?.id()
    }

    /// True once the caller has disconnected: nobody waits for the answer any more.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// Takes room for an answer of at most so many bytes, beside the echo of the caller's `id`, before it is computed. Small ones need
    /// none to be taken.
    ///
    /// # Errors
    /// If there is none.
    pub fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        let Some(address) = self.address.as_mut().filter(|_| bytes > SMALL_ANSWER) else {
            return Ok(());
        };
        let Some(account) = &address.account else {
            return Ok(());
        };
        let id = address.id.as_ref().map_or(0, |id| id.get().len());
        let since = self.asked_for_room;
        let is_out_of_patience = since.is_some_and(|since| since.elapsed() >= ROOM_TIME);
        let bytes = bytes.saturating_add(2 * id + SMALL_ANSWER);
        match account.promise(bytes, is_out_of_patience) {
            Ok(promise) => {
                address.promise = Some(promise);
                Ok(())
            }
            Err(NoRoom::Now) if !is_out_of_patience => {
                // Answers are on their way to clients that read them: those make room in a moment.
                self.asked_for_room.get_or_insert_with(Instant::now);
                Err(NoRoom::Yet)
            }
            Err(why) => Err(why),
        }
    }

    /// Answers `result: true`; the call ends when this is dropped.
    pub fn succeed(&mut self, values: &impl Serialize) {
        self.answer_at_once(|address| address.response(values, ""));
    }

    /// Answers `result: false` with empty values, for the reason `why`.
    pub fn refuse(&mut self, why: &str) {
        self.answer_at_once(|address| address.failure(why));
    }

    /// Answers and ends the call; `write` is called by the registry.
    fn conclude(
        mut self,
        done: Option<Done>,
        write: impl FnOnce(&Address) -> Bytes + Send + 'static,
    ) {
        if let Some(address) = self.address.take() {
            let service = address.service;
            let write = move || {
                let frame = write(&address);
                address.counted(frame)
            };
            self.send(service, Frame::unwritten(write), done);
        }
    }

    fn answer_at_once(&mut self, write: impl FnOnce(&Address) -> Bytes) {
        if let Some(address) = self.address.take() {
            let frame = write(&address);
            self.send(address.service, address.counted(frame).into(), None);
        }
    }

    fn send(&self, service: Service, frame: Frame, done: Option<Done>) {
        self.registry.do_send(Respond {
            connection: self.connection,
            frame,
            service: Some(service),
            status: None,
            done,
        });
    }
}

impl Drop for Caller {
    fn drop(&mut self) {
        self.answer_at_once(|address| address.failure(&Unserved::Ended.to_string()));
    }
}

// ---- questions that clients can ask -----------------------------------------------------------------------------------

/// A question that clients can ask by calling a service.
pub trait Served: Ask + Sized {
    /// Reads it.
    ///
    /// # Errors
    /// If it does not get as far as the node; all that is wrong with it, by name.
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections>;
}

/// A question whose answer is short: the registry writes the response.
pub trait Answered: Served {
    /// Writes the response.
    fn write(answer: Self::Answer, to: &Address) -> Bytes;
}

/// A question whose answer may be long: the thread that has it writes the response, a piece at a time.
pub trait Streamed: Served {
    /// A response that is being written.
    type Writer: Send + 'static;

    /// Begins to write the response.
    fn begin(answer: Self::Answer, to: &Address) -> Self::Writer;

    /// Writes some more of it; the whole response, once that was the last.
    fn advance(writer: &mut Self::Writer) -> Option<Bytes>;
}

/// A client that has asked `A`.
struct Client<A> {
    caller: Caller,
    question: PhantomData<fn(A)>,
}

impl<A> Client<A> {
    fn answer<T: Send + 'static>(
        self,
        answer: Result<T, Unserved>,
        done: Option<Done>,
        write: impl FnOnce(T, &Address) -> Bytes + Send + 'static,
    ) {
        self.caller.conclude(done, move |address| match answer {
            Ok(answer) => write(answer, address),
            Err(why) => address.failure(&why.to_string()),
        });
    }
}

impl<A: Answered> Asker<A::Answer> for Client<A> {
    fn answer(self: Box<Self>, answer: Result<A::Answer, Unserved>, done: Option<Done>) {
        Client::answer(*self, answer, done, A::write);
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(self.caller.connection())
    }

    fn is_gone(&self) -> bool {
        self.caller.is_gone()
    }

    fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        self.caller.reserve(bytes)
    }
}

/// The same where the answer may be long.
struct PatientClient<A>(Client<A>);

impl<A: Streamed> Asker<A::Answer> for PatientClient<A> {
    fn answer(self: Box<Self>, answer: Result<A::Answer, Unserved>, done: Option<Done>) {
        self.0.answer(answer, done, |answer, to| {
            let mut writer = A::begin(answer, to);
            loop {
                if let Some(frame) = A::advance(&mut writer) {
                    return frame;
                }
            }
        });
    }

    fn answer_in_pieces(self: Box<Self>, answer: A::Answer) -> Box<dyn Pieces> {
        let caller = self.0.caller;
        let writer = caller.address.as_ref().map(|to| A::begin(answer, to));
        Box::new(Writing::<A> { caller, writer })
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(self.0.caller.connection())
    }

    fn is_gone(&self) -> bool {
        self.0.caller.is_gone()
    }

    fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        self.0.caller.reserve(bytes)
    }
}

/// A response that is being written.
struct Writing<A: Streamed> {
    caller: Caller,
    /// None once the response is on its way.
    writer: Option<A::Writer>,
}

impl<A: Streamed> Pieces for Writing<A> {
    fn advance(&mut self) -> bool {
        if let Some(writer) = &mut self.writer {
            let Some(frame) = A::advance(writer) else {
                return false;
            };
            self.writer = None;
            self.caller.answer_at_once(|_| frame);
        }
        true
    }

    fn refuse(&mut self, why: Unserved) {
        self.writer = None;
        self.caller
            .answer_at_once(|address| address.failure(&why.to_string()));
    }

    fn is_gone(&self) -> bool {
        self.caller.is_gone()
    }
}

// ---- routes ---------------------------------------------------------------------------------------------------------

/// Hands what has come to the node that is meant.
pub type Route<T> = Box<dyn Fn(T) + Send>;

/// The runtime's own nodes: who serves, listens and publishes what.
#[derive(Default)]
pub struct Nodes {
    /// The way of a call to the node that answers it.
    pub services: HashMap<Service, Route<ServiceCall>>,
    /// The way of a goal to the node that pursues it.
    pub actions: HashMap<Action, Route<ActionRequest>>,
    /// The way of a message to the node that listens to its topic.
    pub listeners: HashMap<Topic, Route<TopicMessage>>,
    /// The node that publishes each of the runtime's topics.
    pub publishers: HashMap<Topic, Recipient<Interest>>,
}

impl Nodes {
    /// A row of a node's table: calls of `service` are this question.
    pub fn serve<A: Answered>(&mut self, service: Service, node: impl Into<Recipient<Call<A>>>) {
        self.route(service, node.into(), |caller| Client::<A> {
            caller,
            question: PhantomData,
        });
    }

    /// The same where the answer may be long.
    pub fn serve_long<A: Streamed>(
        &mut self,
        service: Service,
        node: impl Into<Recipient<Call<A>>>,
    ) {
        self.route(service, node.into(), |caller| {
            PatientClient(Client::<A> {
                caller,
                question: PhantomData,
            })
        });
    }

    /// Reads what is asked, or says what is wrong with it.
    fn route<A: Served, C: Asker<A::Answer> + 'static>(
        &mut self,
        service: Service,
        node: Recipient<Call<A>>,
        asker: fn(Caller) -> C,
    ) {
        let take = move |call: ServiceCall| {
            let node = node.clone();
            let is_long = call.arguments.payload().get().len() > LONG_ARGUMENTS;
            let read = move || {
                let mut caller = call.caller;
                match A::read(call.service, &call.arguments) {
                    Ok(ask) => {
                        let done = caller.done.take();
                        let reply = Reply::new(asker(caller), done);
                        node.do_send(Call { ask, reply });
                    }
                    Err(rejections) => caller.refuse(&rejections.status()),
                }
            };
            if is_long {
                actix_rt::spawn(aside(Errand::Reading, read));
            } else {
                read();
            }
        };
        self.services.insert(service, Box::new(take));
    }
}
