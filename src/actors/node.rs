//! The language of the nodes: questions with their one answer, messages on topics, interest.
//!
//! A service is a question, [`Ask`], and a node serves it by a handler for [`Call`] of that question. The asker,
//! a client or another node, is behind the [`Reply`].
//!
//! **Invariant:** every [`Call`] is answered exactly once, even if the node that has it fails: a [`Reply`] that
//! is dropped unanswered answers with an error.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::oneshot;

use super::ConnectionId;
use crate::actors::resources::memory::NoRoom;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, Level};
use crate::protocol::wire::json::Payload;
pub use crate::services::Ask;

// ---- questions ------------------------------------------------------------------------------------------------------

/// A question on its way to the node that serves it, answered through `reply`.
///
/// actix's own answers come back by a way of their own. A client's answer has to stay behind the messages that the node
/// has published before it, so it takes the way that they take, to the registry.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Call<A: Ask> {
    /// The question.
    pub ask: A,
    /// The way back.
    pub reply: Reply<A::Answer>,
}

/// The end, and the reason for it: calls that wait are refused, goals aborted. From the runtime, once the registry lets
/// nothing more through.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct ShutDown(pub &'static str);

/// Why a question has no answer. Its effect has not happened, and will not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unserved {
    /// The node dropped it.
    #[error("the node that serves this ended before it answered")]
    Ended,
    /// Another node, which that one had to ask, is gone.
    #[error("{0} does not answer")]
    NoAnswer(
        /// Its name.
        &'static str,
    ),
    /// Nobody waits for the answer.
    #[error("the caller is gone")]
    CallerGone,
    /// Too many questions wait, or none is taken.
    #[error("{0}")]
    Refused(
        /// Why.
        &'static str,
    ),
}

/// A guard of an op that has yet to take effect: a call, a goal, or a message on its way to its subscribers. The
/// connection reads the client's next frame once the last clone is dropped.
pub type Done = Arc<oneshot::Sender<()>>;

/// A guard, and the receiver that ends with its last clone.
#[must_use]
pub fn guard() -> (Done, oneshot::Receiver<()>) {
    let (done, ended) = oneshot::channel();
    (Arc::new(done), ended)
}

/// The asker.
pub trait Asker<T>: Send {
    /// Takes the one answer. The news of the call's end, where it is there, travels with it.
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, done: Option<Done>);

    /// Takes the one answer, and writes its response on the present thread: it may have megabytes.
    fn answer_here(self: Box<Self>, answer: T) {
        self.answer(Ok(answer), None);
    }

    /// The client that asked; none if it was a node.
    fn client(&self) -> Option<ConnectionId> {
        None
    }

    /// True once nobody waits for the answer any more.
    fn is_gone(&self) -> bool {
        false
    }

    /// Hears, before the answer, why what it asked for has no effect yet. A node finds that in the answer.
    fn warn(&self, _why: &str) {}

    /// Takes room for an answer of at most `bytes` bytes before it is computed.
    ///
    /// # Errors
    /// While there is none.
    fn reserve(&mut self, _bytes: usize) -> Result<(), NoRoom> {
        Ok(())
    }
}

/// The way back to the asker: one answer, then the end of the call.
///
/// A client that called is read no further until this value is dropped. So a call that has effects after its
/// answer (a goal's setpoint) has had them before the client's next request is looked at.
pub struct Reply<T> {
    /// None once the answer has been given.
    asker: Option<Box<dyn Asker<T>>>,
    done: Option<Done>,
}

impl<T> Reply<T> {
    /// A reply to `asker`; `done` is dropped with it.
    #[must_use]
    pub fn new(asker: impl Asker<T> + 'static, done: Option<Done>) -> Self {
        Self {
            asker: Some(Box::new(asker)),
            done,
        }
    }

    /// The client that asked; none if it was a node.
    #[must_use]
    pub fn client(&self) -> Option<ConnectionId> {
        self.asker.as_ref().and_then(|asker| asker.client())
    }

    /// True once nobody waits for the answer any more.
    #[must_use]
    pub fn caller_is_gone(&self) -> bool {
        self.asker.as_ref().is_some_and(|asker| asker.is_gone())
    }

    /// Takes room for an answer of at most `bytes` bytes before it is computed. Small ones need none to be taken.
    ///
    /// # Errors
    /// While there is none.
    pub fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        match &mut self.asker {
            Some(asker) => asker.reserve(bytes),
            None => Ok(()),
        }
    }

    /// Tells a client by a status, before the answer, why what it asked for has no effect yet.
    pub fn warn(&self, why: &str) {
        if let Some(asker) = &self.asker {
            asker.warn(why);
        }
    }

    /// Answers and ends the call: all its effects have been had. One message carries both.
    pub fn conclude(mut self, answer: T) {
        let done = self.done.take();
        self.send(Ok(answer), done);
    }

    /// Answers; the call ends when this is dropped.
    pub fn answer(&mut self, answer: T) {
        self.send(Ok(answer), None);
    }

    /// Answers; the response is written on the present thread, because it may have megabytes.
    pub fn answer_here(&mut self, answer: T) {
        if let Some(asker) = self.take() {
            asker.answer_here(answer);
        }
    }

    /// Says that there is no answer.
    pub fn refuse(&mut self, why: Unserved) {
        self.send(Err(why), None);
    }

    fn send(&mut self, answer: Result<T, Unserved>, done: Option<Done>) {
        if let Some(asker) = self.take() {
            asker.answer(answer, done);
        }
    }

    fn take(&mut self) -> Option<Box<dyn Asker<T>>> {
        let asker = self.asker.take();
        debug_assert!(asker.is_some(), "a call was answered twice");
        asker
    }
}

impl<T> Drop for Reply<T> {
    fn drop(&mut self) {
        if self.asker.is_some() {
            self.refuse(Unserved::Ended);
        }
    }
}

impl<T: Send> Asker<T> for oneshot::Sender<Result<T, Unserved>> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        // Nobody may be waiting any more.
        let _ = self.send(answer);
    }

    fn is_gone(&self) -> bool {
        self.is_closed()
    }
}

/// Asks another node.
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
    async move { answer.await.unwrap_or(Err(Unserved::Ended)) }
}

// ---- between the registry and the nodes -----------------------------------------------------------------------------

/// Whether anybody subscribes to a topic that the node publishes. From the registry, at every change.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Interest {
    /// The topic.
    pub topic: Topic,
    /// True from the first subscriber until the last one is gone.
    pub wanted: bool,
}

/// A frame for clients: written, or yet to be written by the registry, whose thread has the time that the arm's has
/// not.
pub enum FrameOut {
    /// The frame as it goes out.
    Written(Bytes),
    /// Writes it.
    Unwritten(Box<dyn FnOnce() -> Bytes + Send>),
}

impl FrameOut {
    /// A frame that the registry writes.
    #[must_use]
    pub fn unwritten(write: impl FnOnce() -> Bytes + Send + 'static) -> Self {
        Self::Unwritten(Box::new(write))
    }

    /// The frame as it goes out.
    #[must_use]
    pub fn write(self) -> Bytes {
        match self {
            Self::Written(frame) => frame,
            Self::Unwritten(write) => write(),
        }
    }
}

impl From<Bytes> for FrameOut {
    fn from(frame: Bytes) -> Self {
        Self::Written(frame)
    }
}

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
    /// The message that `make` makes; it is made and written by the registry.
    #[must_use]
    pub fn made<M: Serialize>(topic: Topic, make: impl FnOnce() -> M + Send + 'static) -> Self {
        let frame = FrameOut::unwritten(move || messages::publish(topic.name(), &make()));
        Self { topic, frame }
    }
}

/// A frame for one client: an answer or a status. From a node.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Respond {
    /// The client.
    pub connection: ConnectionId,
    /// The whole frame.
    pub frame: FrameOut,
    /// The service that it answers, if it is the runtime's own.
    pub service: Option<Service>,
    /// The level, if it is a status: sent only if the client wants such.
    pub status: Option<Level>,
    /// Dropped once the frame is on its way, where that is also the end of the call.
    pub done: Option<Done>,
}

impl Respond {
    /// An error status that says why; `id` is that of the frame at fault.
    #[must_use]
    pub fn error(connection: ConnectionId, why: &str, id: Option<&Payload>) -> Self {
        Self::status(connection, Level::Error, why, id)
    }

    /// A status of this level; `id` is that of the frame that it is about.
    #[must_use]
    pub fn status(connection: ConnectionId, level: Level, msg: &str, id: Option<&Payload>) -> Self {
        let (msg, id) = (msg.to_owned(), id.cloned());
        let write = move || messages::status(level, &msg, id.as_ref());
        Self {
            connection,
            frame: FrameOut::unwritten(write),
            service: None,
            status: Some(level),
            done: None,
        }
    }
}

/// Feedback of a goal, for the client that sent it; may be dropped when that is slow. From the node that pursues the
/// goal.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Feedback {
    /// The client.
    pub connection: ConnectionId,
    /// The whole frame.
    pub frame: FrameOut,
}
