//! Questions with one answer.
//!
//! **Invariant:** a question is answered exactly once, even if its node fails: a [`Reply`] that is dropped unanswered
//! sends an error.

use std::future::ready;
use std::pin::Pin;

use actix::prelude::*;
use tokio::sync::oneshot;

use super::completion::Working;
use crate::services::Ask;

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

/// The asker.
pub trait Asker<T>: Send {
    /// Writes and sends the one answer. If the call ends with the answer, `working` is sent with it.
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, working: Option<Working>);

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
    working: Option<Working>,
}

impl<T> Reply<T> {
    /// A reply to `asker`. `working` is dropped with it.
    #[must_use]
    pub fn new(asker: impl Asker<T> + 'static, working: Option<Working>) -> Self {
        Self {
            asker: Some(Box::new(asker)),
            working,
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
        let working = self.working.take();
        self.send(Ok(answer), working);
    }

    /// Answers. The call ends when this value is dropped.
    pub fn answer(&mut self, answer: T) {
        self.send(Ok(answer), None);
    }

    /// Sends the error that there is no answer.
    pub fn refuse(&mut self, why: Unserved) {
        self.send(Err(why), None);
    }

    fn send(&mut self, answer: Result<T, Unserved>, working: Option<Working>) {
        debug_assert!(self.asker.is_some(), "a call was answered twice");
        if let Some(asker) = self.asker.take() {
            asker.answer(answer, working);
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
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Working>) {
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
