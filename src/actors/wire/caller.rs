//! A call as the registry has it, the client that made it, and the way back.
//!
//! **Invariant:** every call is answered once: a caller that is dropped unanswered says so itself.

use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::node::{Done, FrameOut, Respond, Unserved};
use crate::actors::resources::budget::{Account, NoRoom, Promise};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::trajectory::Heard;
use crate::protocol::messages::{self, ErrorForm};
use crate::protocol::op::Arguments;
use crate::protocol::wire::payload::Payload;

/// Bytes of an answer that is computed without asking for room first: more than any answer has but those that list or
/// compute something.
pub const SMALL_ANSWER: usize = 16 * 1024;
/// How long a computation waits for room that is taken by answers which wait for their clients, before it is refused.
pub const ROOM_TIME: Duration = Duration::from_secs(2);

/// A call of one of the runtime's own services, as the registry has it.
pub struct ServiceCall {
    /// The service that was called.
    pub service: Service,
    /// The caller's arguments, unread.
    pub arguments: Arguments,
    /// The way back.
    pub caller: Caller,
}

/// A client's message on a topic that the runtime subscribes to, as the registry has it.
pub struct TopicMessage {
    /// The message, as far as the runtime needs it.
    pub heard: Heard,
    /// The way back, for an error status.
    pub respond: Recipient<Respond>,
    /// The client.
    pub connection: ConnectionId,
    /// The frame's `id`, if it had one.
    pub id: Option<Payload>,
    /// Dropped when the message has taken effect: the connection reads its next frame then.
    pub done: Done,
}

impl TopicMessage {
    /// Tells the client by an error status why this is no message for `topic`.
    pub fn refuse(self, topic: Topic, why: &impl Display) {
        let msg = format!("{}: {why}", topic.name());
        let status = Respond::error(self.connection, &msg, self.id.as_ref());
        self.respond.do_send(Respond {
            done: Some(self.done),
            ..status
        });
    }
}

/// Destination of a response, and what it has to say of the call.
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
    pub(super) address: Option<Address>,
    gone: Arc<AtomicBool>,
    pub(super) done: Option<Done>,
    /// The time since which waiting answers have left no room for one of megabytes.
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

    /// Takes room for an answer of at most so many bytes, beside the echo of the caller's `id`, before it is computed.
    /// Small ones need none to be taken.
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
    pub(super) fn conclude(
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
            self.send(service, FrameOut::unwritten(write), done);
        }
    }

    pub(super) fn answer_at_once(&mut self, write: impl FnOnce(&Address) -> Bytes) {
        if let Some(address) = self.address.take() {
            let frame = write(&address);
            self.send(address.service, address.counted(frame).into(), None);
        }
    }

    fn send(&self, service: Service, frame: FrameOut, done: Option<Done>) {
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
