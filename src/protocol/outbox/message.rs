//! A topic message that waits in the outbox, or a series of them.
//!
//! **Invariant:** a message that is held back, or kept as the newest of its topic, does not keep the others of its series
//! in memory.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use crate::protocol::catalog::Topic;
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::lines::messages;

/// A topic message that waits, or a series of them.
#[derive(Debug)]
pub(super) struct QueuedMessage {
    /// Its number in the order of production.
    pub(super) number: u64,
    /// When it was produced.
    pub(super) since: Instant,
    /// Its topic. Feedback of a goal has none.
    pub(super) topic: Option<Arc<str>>,
    pub(super) frame: Bytes,
}

impl QueuedMessage {
    pub(super) fn is_on(&self, topic: &Arc<str>) -> bool {
        let own = self.topic.as_ref();
        own.is_some_and(|own| Arc::ptr_eq(own, topic) || own == topic)
    }

    /// Whether it is the end of a goal. It is neither dropped because of its age, nor before other messages, because
    /// there are few, and clients wait for each.
    pub(super) fn is_end_of_goal(&self) -> bool {
        self.topic.as_deref() == Some(Topic::IkResult.name())
    }

    pub(super) fn is_older(&self, age: Duration, now: Instant) -> bool {
        self.since.checked_add(age).is_some_and(|end| end < now)
    }

    /// The number of messages.
    pub(super) fn count(&self) -> u64 {
        messages(self.frame.clone()).count() as u64
    }
}

/// The counted bytes of a message or a series.
pub(super) fn counted(frame: &Bytes) -> usize {
    frame.len().min(MEDIUM)
}

/// The topic messages that wait, queued or held back: their number, and the bytes of them that count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Waiting {
    pub(super) count: usize,
    pub(super) bytes: usize,
}

impl Waiting {
    pub(super) fn add(&mut self, message: &QueuedMessage) {
        self.count += 1;
        self.bytes += counted(&message.frame);
    }

    pub(super) fn forget(&mut self, message: &QueuedMessage) {
        self.count -= 1;
        self.bytes -= counted(&message.frame);
    }
}
