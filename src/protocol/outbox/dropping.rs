//! Topic messages that there is no room for, that are too old, or that are wanted no more.
//!
//! **Invariant:** the oldest go first, whole.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Buf, Bytes};

use super::{
    MAX_AGE, MAX_AGE_BEHIND, MAX_MESSAGE, MAX_TOPIC_BYTES, MESSAGE_BYTES, Outbox, QueuedMessage,
    by_itself,
};
use crate::protocol::outbox::queues::{Timestamp, counted};
use crate::protocol::wire::series::{first_message, first_messages, last_messages, messages};

impl Outbox {
    /// Whether there is room for a message once all else has gone; if not, it counts as dropped.
    pub(super) fn may_fit(&mut self, frame: &Bytes) -> bool {
        let fits = frame.len() <= MAX_MESSAGE;
        self.dropped += u64::from(!fits);
        fits
    }

    /// Drops the messages that have waited for too long, except the newest of each topic.
    pub(super) fn drop_old(&mut self, now: Instant) {
        loop {
            let age = if self.is_behind {
                MAX_AGE_BEHIND
            } else {
                MAX_AGE
            };
            let oldest = self.oldest_at(now, age);
            let next = self.topics.range(self.looked_at..).next();
            let Some((&number, _)) = next.filter(|(_, message)| message.since < oldest) else {
                return;
            };
            self.looked_at = number + 1;
            let dropped = self.dropped;
            self.drop_but_newest(number);
            self.is_behind |= self.dropped > dropped;
        }
    }

    /// Drops the first topic message if it is too old to be taken only because a response is behind it; false if it is
    /// not.
    pub(super) fn drop_stale(&mut self, now: Instant) -> bool {
        let oldest = self.oldest_at(now, self.fresh);
        let first = self.topics.first_key_value();
        let Some((&number, _)) = first.filter(|(_, message)| message.since < oldest) else {
            return false;
        };
        self.drop_but_newest(number)
    }

    /// Drops a message, or all of a series, except the newest of the topic; true if nothing is left.
    fn drop_but_newest(&mut self, number: u64) -> bool {
        let Some(message) = self.topics.get_mut(&number) else {
            return true;
        };
        let is_newest = |topic: &Arc<str>| self.queues.newest(topic) == Some(number);
        if !message.topic.as_ref().is_some_and(is_newest) {
            self.drop_message(Some(number));
            return true;
        }
        if first_message(&message.frame) == message.frame.len() {
            // The pieces of a message stay together.
            return false;
        }
        let newest = by_itself(last_messages(message.frame.clone(), 1), true);
        let older = message.frame.len() - newest.len();
        self.dropped += messages(message.frame.slice(..older)).count() as u64;
        self.topic_bytes -= counted(&message.frame);
        self.topic_bytes += counted(&newest);
        message.frame = newest;
        false
    }

    /// Drops a message, or all of a series, if there is one with that number.
    pub(super) fn drop_message(&mut self, number: Option<u64>) {
        let message = number.and_then(|number| self.take_out(number));
        if let Some(frame) = message {
            self.dropped += messages(frame.clone()).count() as u64;
        }
    }

    /// Takes the first topic message out of the queue.
    pub(super) fn take_out_first(&mut self) -> Option<Bytes> {
        let number = *self.topics.first_key_value()?.0;
        self.take_out(number)
    }

    fn take_out(&mut self, number: u64) -> Option<Bytes> {
        let QueuedMessage { frame, topic, .. } = self.topics.remove(&number)?;
        self.topic_bytes -= counted(&frame);
        if let Some(topic) = topic {
            self.queues.leave(&topic, number);
        }
        Some(frame)
    }

    /// The least time of a message that is not older than `age`.
    pub(super) fn oldest_at(&mut self, now: Instant, age: Duration) -> Timestamp {
        let age = Timestamp::try_from(age.as_micros()).unwrap_or(Timestamp::MAX);
        self.timestamp(now).saturating_sub(age)
    }

    /// Drops topic messages, the oldest first, until what is left takes at most [`MAX_TOPIC_BYTES`]. The oldest is the
    /// queue's first or the one that was held back first. A series loses as many messages at once as have to go;
    /// held-back messages go at once as far as they are older than the queue's first.
    pub(super) fn keep_bounded(&mut self) {
        loop {
            let cost = self.topic_bytes() + self.topic_count() * MESSAGE_BYTES;
            let mut excess = cost.saturating_sub(MAX_TOPIC_BYTES);
            if excess == 0 {
                return;
            }
            let first = self.topics.first_key_value();
            let queued = first.map_or(u64::MAX, |(number, _)| *number);
            if self.throttles.oldest().is_some_and(|held| held < queued) {
                let goes = |bytes| {
                    let goes = excess > 0;
                    excess = excess.saturating_sub(bytes + MESSAGE_BYTES);
                    goes
                };
                self.dropped += self.throttles.give_up_oldest(queued, goes);
            } else if let Some(mut first) = self.topics.first_entry() {
                let frames = &mut first.get_mut().frame;
                let (bytes, count) = first_messages(frames, excess);
                self.dropped += count as u64;
                if bytes < frames.len() {
                    self.topic_bytes -= counted(frames);
                    frames.advance(bytes);
                    self.topic_bytes += counted(frames);
                } else {
                    self.take_out_first();
                }
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
        }
    }
}
