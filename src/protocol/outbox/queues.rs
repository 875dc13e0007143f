//! The topics of the messages in an outbox: the newest of each, and how many may wait.
//!
//! **Invariant:** the messages of a topic leave the oldest first. A topic without messages and without a bound takes no
//! memory.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use bytes::Bytes;

use crate::protocol::limits::MEDIUM;

/// Microseconds since the outbox was first used: half the bytes of an [`Instant`](std::time::Instant).
pub(super) type Timestamp = u64;

/// Bytes of a message, or of a series, that count.
pub(super) fn counted(frame: &Bytes) -> usize {
    frame.len().min(MEDIUM)
}

/// Every topic that has messages in the outbox, or a bound.
#[derive(Debug, Default)]
pub(super) struct Queues {
    topics: HashMap<Arc<str>, TopicQueue>,
}

/// The messages of one topic.
#[derive(Debug, Default)]
struct TopicQueue {
    /// The number of the newest.
    newest: u64,
    /// How many messages, or series of them, wait.
    count: usize,
    /// How many may wait.
    bound: Option<usize>,
    /// The numbers of those that came while there was a bound.
    bounded: VecDeque<u64>,
}

impl Queues {
    /// How many messages of a topic may wait, if that is bounded.
    pub(super) fn bound(&self, topic: &str) -> Option<usize> {
        self.topics.get(topic)?.bound
    }

    pub(super) fn set_bound(&mut self, topic: &Arc<str>, bound: Option<usize>) {
        if bound.is_none() {
            return self.forget_bound(topic);
        }
        self.topics.entry(Arc::clone(topic)).or_default().bound = bound;
    }

    pub(super) fn forget_bound(&mut self, topic: &str) {
        if let Some(queue) = self.topics.get_mut(topic) {
            queue.bound = None;
            queue.bounded = VecDeque::new();
            self.tidy(topic);
        }
    }

    /// Notes a new message; gives the number of the newest before it, if that still waits.
    pub(super) fn enter(&mut self, topic: &Arc<str>, number: u64) -> Option<u64> {
        let queue = self.topics.entry(Arc::clone(topic)).or_default();
        let before = (queue.count > 0).then_some(queue.newest);
        queue.newest = number;
        queue.count += 1;
        if queue.bound.is_some() {
            queue.bounded.push_back(number);
        }
        before
    }

    /// Notes that the oldest message of a topic has left.
    pub(super) fn leave(&mut self, topic: &str, number: u64) {
        if let Some(queue) = self.topics.get_mut(topic) {
            queue.count -= 1;
            if queue.bounded.front() == Some(&number) {
                queue.bounded.pop_front();
            }
            self.tidy(topic);
        }
    }

    /// The newest message of a topic.
    pub(super) fn newest(&self, topic: &str) -> Option<u64> {
        self.topics.get(topic).map(|queue| queue.newest)
    }

    /// The oldest message of a topic, if more wait than may.
    pub(super) fn surplus(&self, topic: &str) -> Option<u64> {
        let TopicQueue { bound, bounded, .. } = self.topics.get(topic)?;
        (bounded.len() > (*bound)?).then(|| bounded.front().copied())?
    }

    fn tidy(&mut self, topic: &str) {
        let is_idle = |queue: &TopicQueue| queue.count == 0 && queue.bound.is_none();
        if self.topics.get(topic).is_some_and(is_idle) {
            self.topics.remove(topic);
            if self.topics.capacity() > 4 * self.topics.len() + 32 {
                self.topics.shrink_to(2 * self.topics.len());
            }
        }
    }
}
