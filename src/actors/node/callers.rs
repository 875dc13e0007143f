//! Clients' calls of the runtime's services, their messages on its topics, and the way back to the client.
//!
//! **Invariant:** a [`Caller`] that is dropped unanswered sends an error. An answer is written on the thread that answers.

use std::fmt::Display;
use std::sync::Weak;
use std::time::Duration;

use bytes::Bytes;
use serde::Serialize;
use tokio::time::timeout;

use super::completion::{Completion, Working};
use super::registry::{ClientLink, FrameKind};
use crate::actors::resources::memory::{Memory, PERMIT_TIME, Permit, SHORT, cover};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::Level;
use crate::protocol::op::Arguments;
use crate::protocol::wire::json::Payload;
use crate::services::Address;

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
    pub working: Working,
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
    /// The permit of the long frame that asked.
    frame_permit: Option<Permit>,
    /// The permit of a long answer.
    answer_permit: Option<Permit>,
    pub(super) working: Option<Working>,
    /// The pools for long answers.
    memory: Memory,
}

impl Caller {
    /// The client that called the service of `address`. `memory` has the pools for long answers, and `permit` is that
    /// of the call's frame, if it was long. The receiver ends with the call.
    pub fn new(
        link: ClientLink,
        address: Address,
        memory: Memory,
        permit: Option<Permit>,
    ) -> (Self, Completion) {
        let (working, completion) = Completion::pending();
        let caller = Self {
            link,
            address: Some(address),
            frame_permit: permit,
            answer_permit: None,
            working: Some(working),
            memory,
        };
        (caller, completion)
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

    /// The same, and asks the system, which takes some microseconds.
    pub(super) fn has_left(&self) -> bool {
        self.link.gone.look()
    }

    /// Sends a status, before the answer.
    pub(super) fn warn(&self, why: &str) {
        self.link.status(Level::Warning, why, self.id());
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
        self.answer_permit = None;
        if bytes > SHORT {
            let limit = self
                .frame_permit
                .as_ref()
                .map_or(Duration::MAX, |_| PERMIT_TIME);
            let permit = timeout(limit, self.memory.answer(bytes));
            tokio::select! {
                biased;
                permit = permit => self.answer_permit = Some(permit.map_err(|_| Unserved::NO_MEMORY)?),
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
    pub(super) fn answer(
        &mut self,
        working: Option<Working>,
        write: impl FnOnce(&Address) -> Bytes,
    ) {
        if let Some(address) = self.address.take() {
            let permit = self.answer_permit.as_ref().or(self.frame_permit.as_ref());
            let frame = cover(permit, write(&address));
            let kind = FrameKind::Answer(address.service());
            self.link.send(kind, frame, working);
        }
    }
}

impl Drop for Caller {
    fn drop(&mut self) {
        self.refuse(&Unserved::ENDED.to_string());
    }
}
