//! Drops topic messages, the oldest first: too many, too old, or too long.
//!
//! The end of a goal is dropped last.
//!
//! **Invariant:** whole messages are dropped, nothing is reordered, and each dropped message is counted.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::Outbox;
use super::message::{QueuedMessage, counted};
use crate::protocol::limits::MAX_FRAME;
use crate::protocol::wire::lines::{by_itself, first_message, first_messages, last_messages};

/// Most bytes of topic messages that wait for one connection, each with [`MESSAGE_BYTES`]: ten seconds of the arm's
/// own. A message longer than [`MEDIUM`](crate::protocol::limits::MEDIUM) uses the shared pool and counts as that many
/// bytes here, so at most one of them waits.
pub const MAX_TOPIC_BYTES: usize = 304 * 1024;
/// The longest topic message: the longest frame of a client, and the newline after it.
pub const MAX_MESSAGE: usize = MAX_FRAME + 1;
/// Largest age of a waiting topic message. Older ones are dropped, except the newest of its topic.
pub const MAX_AGE: Duration = Duration::from_secs(1);
/// The same after a message has been too old, until the queue is empty. The client is then slower than its topics.
/// Its messages are late by this time and by its unread bytes.
const MAX_AGE_BEHIND: Duration = Duration::from_millis(500);
/// Bytes counted for a waiting message besides its own: reference count, queue entry, and the allocator's overhead.
pub const MESSAGE_BYTES: usize = 160;

impl Outbox {
    /// Whether a message fits into an empty outbox. If not, it counts as dropped.
    pub(super) fn may_fit(&mut self, frame: &Bytes) -> bool {
        let fits = frame.len() <= MAX_MESSAGE;
        self.dropped += u64::from(!fits);
        fits
    }

    /// Queues held messages that are due. Drops queued ones that are too old, except the newest of each topic.
    pub(super) fn advance(&mut self, now: Instant) {
        self.release(now);
        while let Some(next) = self.topics.get(self.kept_old) {
            let age = if self.is_behind {
                MAX_AGE_BEHIND
            } else {
                MAX_AGE
            };
            if !next.is_older(age, now) {
                return;
            }
            let dropped = self.dropped;
            if !self.drop_but_newest(self.kept_old) {
                self.kept_old += 1;
            }
            self.is_behind |= self.dropped > dropped;
        }
    }

    /// Drops the first topic message if it is too old to be taken only because a response follows it. Returns `false`
    /// if it is not too old, or is the newest of its topic.
    pub(super) fn drop_stale(&mut self, now: Instant) -> bool {
        let is_stale = |first: &QueuedMessage| first.is_older(self.fresh, now);
        self.topics.front().is_some_and(is_stale) && self.drop_but_newest(0)
    }

    /// Drops a message, or a whole series, except the newest of the topic and the end of a goal. Returns `true` if nothing is left.
    fn drop_but_newest(&mut self, index: usize) -> bool {
        let mut rest = self.topics.range_mut(index..);
        let Some(message) = rest.next() else {
            return true;
        };
        if message.is_end_of_goal() {
            return false;
        }
        let is_newest = |topic: &Arc<str>| !rest.any(|newer| newer.is_on(topic));
        if !message.topic.as_ref().is_some_and(is_newest) {
            self.drop_message(index);
            return true;
        }
        // The pieces of a message are dropped together.
        if first_message(&message.frame) < message.frame.len() {
            let newest = by_itself(last_messages(message.frame.clone(), 1), true);
            self.dropped += message.count() - 1;
            self.waiting.bytes -= counted(&message.frame);
            self.waiting.bytes += counted(&newest);
            message.frame = newest;
        }
        false
    }

    /// Drops topic messages, the oldest first, until at most [`MAX_TOPIC_BYTES`] are left. The oldest is the first in
    /// the queue or the first held one. A series loses as many messages at once as necessary. Ends of goals are dropped
    /// after all others.
    pub(super) fn keep_bounded(&mut self) {
        loop {
            let cost = self.topic_bytes() + self.topic_count() * MESSAGE_BYTES;
            let excess = cost.saturating_sub(MAX_TOPIC_BYTES);
            if excess == 0 {
                return;
            }
            let mut queue = self.topics.iter();
            let first = queue.position(|message| !message.is_end_of_goal());
            let first = first.unwrap_or(0);
            let queued = self.topics.get(first);
            let queued = queued.map_or(u64::MAX, |first| first.number);
            let held = self.limits.values_mut();
            let held = held.filter(|one| one.first_held().is_some_and(|held| held < queued));
            let held = held.min_by_key(|limits| limits.first_held());
            if let Some(oldest) = held.and_then(|limits| limits.held.pop_front()) {
                self.waiting.forget(&oldest);
                self.dropped += 1;
            } else if first > 0 {
                self.drop_message(first);
            } else if let Some(QueuedMessage { frame, .. }) = self.topics.front() {
                let (bytes, count) = first_messages(frame, excess);
                self.dropped += count as u64;
                self.take_first(bytes);
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
        }
    }
}
