//! The messages of the nodes: questions with one answer, messages on topics, interest.
//!
//! A service is a question, [`Ask`], and a node serves it by a handler for [`Call`] of that question. The asker,
//! a client or another node, is behind the [`Reply`].
//!
//! **Invariant:** every [`Call`] is answered exactly once, even if its node fails: a [`Reply`] that is dropped
//! unanswered sends an error.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;

use super::ConnectionId;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, Level};
use crate::protocol::wire::json::Payload;
pub use crate::services::Ask;

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
}

/// A guard of an op that has not yet taken effect: a call, a goal, or a message for its subscribers. The
/// connection reads the client's next frame once the last clone is dropped.
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

    /// Sends, before the answer, the reason why the request has no effect yet. For a node this is in the answer.
    fn warn(&self, _why: &str) {}

    /// Reserves memory for an answer of at most `bytes` bytes before it is computed. `false` while there is not enough.
    fn reserve(&mut self, _bytes: usize) -> bool {
        true
    }
}

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

    /// Reserves memory for an answer of at most `bytes` bytes before it is computed. `false` while there is not enough.
    /// Short answers need no reservation.
    pub fn reserve(&mut self, bytes: usize) -> bool {
        let asker = self.asker.as_mut();
        asker.is_none_or(|asker| asker.reserve(bytes))
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

/// A frame for one client. From a node, or from the client's own connection.
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
    pub gone: Arc<AtomicBool>,
}

impl ClientLink {
    /// Whether the client has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
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
