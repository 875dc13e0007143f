//! What the registry and every node speak to one another: calls with their reply, topic messages, interest.
//!
//! **Invariant:** every [`ServiceCall`] is answered exactly once, whatever happens to the node that has it: a [`Reply`]
//! that is dropped unanswered says so itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use serde_json::value::RawValue;
use tokio::sync::oneshot;

use super::ConnectionId;
use super::budget::{Budget, Claim, NoRoom, Promise};
use super::registry::Respond;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages;
use crate::protocol::op::Arguments;

/// Bytes of an answer for which there is always room, beside twice the caller's `id`: more than any answer has but those that list or
/// compute something.
pub const SMALL_ANSWER: usize = 16 * 1024;
/// How long a computation waits for room that is taken by answers which wait for their clients, before it is refused.
pub const ROOM_TIME: Duration = Duration::from_secs(2);

/// A call of one of the runtime's own services. From the registry; answered through `reply`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct ServiceCall {
    /// Which service.
    pub service: Service,
    /// The caller's arguments, unread.
    pub arguments: Arguments,
    /// The way back to the caller.
    pub reply: Reply,
}

/// A message on a topic that the runtime subscribes to. From the registry; bad ones are answered by an error status.
#[derive(Message)]
#[rtype(result = "()")]
pub struct TopicMessage {
    /// The message as it came.
    pub msg: Box<RawValue>,
    /// Who sent it; `None` for one of the runtime's own nodes.
    pub sender: Option<Sender>,
}

/// The client that sent a [`TopicMessage`], and what its error status must carry.
pub struct Sender {
    /// The connection.
    pub connection: ConnectionId,
    /// The frame's `id`, if it had one.
    pub id: Option<Box<RawValue>>,
    /// Dropped when the message has taken effect: the connection reads its next frame then.
    pub done: oneshot::Sender<()>,
}

/// Whether anybody subscribes to a topic that the node publishes. From the registry, at every change.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Interest {
    /// The topic.
    pub topic: Topic,
    /// True from the first subscriber until the last one is gone.
    pub wanted: bool,
}

/// The way back to the caller of a service: one answer, then the end of the call.
///
/// The connection that called reads no further frame until this value is dropped, so that a call that has effects
/// after its answer (a goal's trajectory) has had them before the client's next request is looked at.
pub struct Reply {
    registry: Recipient<Respond>,
    connection: ConnectionId,
    service: Service,
    name: Box<str>,
    id: Option<Box<RawValue>>,
    gone: Arc<AtomicBool>,
    answered: bool,
    done: Option<oneshot::Sender<()>>,
    /// The total that answers count in.
    budget: Option<Budget>,
    /// What was taken for an answer of megabytes.
    promise: Option<Promise>,
    /// Since when answers that wait have left no room for that.
    asked_for_room: Option<Instant>,
}

impl Reply {
    /// A reply to `connection` for its call of `service`, spelled `name`; the receiver ends when the reply is dropped.
    #[must_use]
    pub fn new(
        registry: Recipient<Respond>,
        connection: ConnectionId,
        service: Service,
        name: Box<str>,
        id: Option<Box<RawValue>>,
        gone: Arc<AtomicBool>,
    ) -> (Self, oneshot::Receiver<()>) {
        let (done, ended) = oneshot::channel();
        (
            Self {
                registry,
                connection,
                service,
                name,
                id,
                gone,
                answered: false,
                done: Some(done),
                budget: None,
                promise: None,
                asked_for_room: None,
            },
            ended,
        )
    }

    /// The answer counts in this total until it has been written.
    #[must_use]
    pub fn within(mut self, budget: Budget) -> Self {
        self.budget = Some(budget);
        self
    }

    /// Takes room for an answer of at most so many bytes, beside the echo of the caller's `id`, before it is computed. Small ones need
    /// none to be taken.
    ///
    /// # Errors
    /// If there is none.
    pub fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        let Some(budget) = self.budget.as_ref().filter(|_| bytes > SMALL_ANSWER) else {
            return Ok(());
        };
        match budget.promise(bytes.saturating_add(self.small_answer())) {
            Ok(promise) => {
                self.promise = Some(promise);
                Ok(())
            }
            Err(NoRoom::Now) => {
                // Answers are on their way to clients that read them: those make room in a moment.
                let since = self.asked_for_room.get_or_insert_with(Instant::now);
                let is_patient = since.elapsed() < ROOM_TIME;
                Err(if is_patient { NoRoom::Yet } else { NoRoom::Now })
            }
            Err(yet) => Err(yet),
        }
    }

    /// The connection that called.
    #[must_use]
    pub fn connection(&self) -> ConnectionId {
        self.connection
    }

    /// True once the caller has disconnected: nobody waits for the answer any more.
    #[must_use]
    pub fn caller_is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// The service's name as the caller spelled it, and the caller's `id`: what an answer must echo.
    #[must_use]
    pub fn address(&self) -> (&str, Option<&RawValue>) {
        (&self.name, self.id.as_deref())
    }

    /// Answers as [`Reply::answer`] does and ends the call: all its effects have been had.
    ///
    /// The news of the end travels with the answer: one thread is woken once, not twice.
    pub fn conclude(mut self, values: &impl Serialize, status: &str) {
        let done = self.done.take();
        let frame = self.encode(values, status);
        self.send(frame, done);
    }

    /// Answers with `values`; `result` is true if `status` is empty.
    pub fn answer(&mut self, values: &impl Serialize, status: &str) {
        let frame = self.encode(values, status);
        self.answer_with(frame);
    }

    /// Answers `result: true`.
    pub fn succeed(&mut self, values: &impl Serialize) {
        self.answer(values, "");
    }

    /// Answers `result: false` with empty values, for the reason `why`.
    pub fn refuse(&mut self, why: &str) {
        self.answer_with(messages::failure(&self.name, self.id.as_deref(), why));
    }

    /// Answers with a whole `service_response` frame that the caller has encoded itself.
    pub fn answer_with(&mut self, frame: Bytes) {
        self.send(frame, None);
    }

    fn encode(&self, values: &impl Serialize, status: &str) -> Bytes {
        messages::response(
            &self.name,
            self.id.as_deref(),
            values,
            status.is_empty(),
            status,
        )
    }

    fn send(&mut self, frame: Bytes, done: Option<oneshot::Sender<()>>) {
        if self.answered {
            debug_assert!(false, "{} was answered twice", self.name);
            return;
        }
        self.answered = true;
        let frame = self.counted(frame);
        self.registry.do_send(Respond {
            connection: self.connection,
            frame,
            service: Some(self.service),
            status: None,
            done,
        });
    }

    /// The answer, counted in the total; a failure instead where a long one finds no room.
    fn counted(&mut self, frame: Bytes) -> Bytes {
        if let Some(promise) = self.promise.take() {
            return promise.cover(frame);
        }
        let Some(budget) = &self.budget else {
            return frame;
        };
        if frame.len() <= self.small_answer() {
            return budget.count(frame);
        }
        match budget.take(frame.len(), Claim::Ordinary) {
            Some(share) => share.cover(frame),
            None => {
                let why = NoRoom::Now.to_string();
                budget.count(messages::failure(&self.name, self.id.as_deref(), &why))
            }
        }
    }

    fn small_answer(&self) -> usize {
        SMALL_ANSWER + 2 * self.id.as_deref().map_or(0, |id| id.get().len())
    }
}

impl Drop for Reply {
    fn drop(&mut self) {
        if !self.answered {
            self.refuse("the node that serves this ended before it answered");
        }
    }
}
