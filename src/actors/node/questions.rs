//! Questions with one answer.
//!
//! **Invariant:** a question is answered exactly once, even if its node fails: a [`Reply`] that is dropped unanswered
//! sends an error.

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;

use super::callers::{Caller, Unserved};
use super::completion::Working;
use crate::services::{Address, Ask};

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

/// The receiver of the one answer.
enum Asker<T> {
    /// A client, with the writer of its response.
    Client(Caller, fn(T, &Address) -> Bytes),
    /// Another node.
    Node(oneshot::Sender<Result<T, Unserved>>),
}

/// The way back to the caller: one answer, then the end of the call. If it is dropped unanswered, the caller gets an
/// error.
///
/// The client's next frame is read only after this value is dropped. So effects after the answer (a goal's
/// setpoint) precede the client's next request.
pub struct Reply<T> {
    /// `None` once the answer has been sent.
    asker: Option<Asker<T>>,
    working: Option<Working>,
}

impl<T> Reply<T> {
    /// A reply to a client. `write` writes its response.
    pub(super) fn to_client(mut caller: Caller, write: fn(T, &Address) -> Bytes) -> Self {
        Self {
            working: caller.working.take(),
            asker: Some(Asker::Client(caller, write)),
        }
    }

    /// A reply to another node. `working` is dropped with it.
    #[must_use]
    pub fn to_node(answer: oneshot::Sender<Result<T, Unserved>>, working: Option<Working>) -> Self {
        let asker = Some(Asker::Node(answer));
        Self { asker, working }
    }

    /// Whether the caller has disconnected.
    #[must_use]
    pub fn caller_is_gone(&self) -> bool {
        match &self.asker {
            Some(Asker::Client(caller, _)) => caller.is_gone(),
            Some(Asker::Node(answer)) => answer.is_closed(),
            None => false,
        }
    }

    /// The same, and asks the system, which takes some microseconds.
    #[must_use]
    pub fn caller_has_left(&self) -> bool {
        match &self.asker {
            Some(Asker::Client(caller, _)) => caller.has_left(),
            _ => self.caller_is_gone(),
        }
    }

    /// Waits for memory for a client's answer of at most `bytes` bytes, before it is computed. Short answers need none.
    /// Refuses the call and returns `false` if there is none.
    pub async fn reserve(&mut self, bytes: usize) -> bool {
        let reserved = match &mut self.asker {
            Some(Asker::Client(caller, _)) => caller.reserve(bytes).await,
            _ => Ok(()),
        };
        reserved.map_err(|why| self.refuse(why)).is_ok()
    }

    /// Sends a client a status, before the answer: why the request has no effect yet. A node finds it in the answer.
    pub fn warn(&self, why: &str) {
        if let Some(Asker::Client(caller, _)) = &self.asker {
            caller.warn(why);
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
        match self.asker.take() {
            Some(Asker::Client(mut caller, write)) => {
                caller.answer(working, |address| match answer {
                    Ok(answer) => write(answer, address),
                    Err(why) => address.failure(&why.to_string()),
                });
            }
            Some(Asker::Node(node)) => {
                // The node may have ended.
                let _ = node.send(answer);
            }
            None => {}
        }
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
    let reply = Reply::to_node(answered, None);
    node.do_send(Call { ask, reply });
    async move { answer.await.unwrap_or(Err(Unserved::ENDED)) }
}
