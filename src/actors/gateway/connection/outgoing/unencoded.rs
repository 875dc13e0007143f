//! Topic messages that have to be encoded before they can be sent.
//!
//! **Invariant:** at most [`MAX_TOPIC_BYTES`] wait, and the oldest are dropped.

use std::collections::HashMap;
use std::sync::Arc;

use crate::actors::gateway::messages::Deliver;
use crate::protocol::outbox::blocks::Blocks;
use crate::protocol::outbox::{MAX_TOPIC_BYTES, PLACE_BYTES};
use crate::protocol::wire::series;

/// The messages of one connection that wait.
#[derive(Default)]
pub(super) struct Unencoded {
    waiting: Blocks<Deliver>,
    /// Their bytes, as they came.
    bytes: usize,
    /// How many messages of each topic wait or are being encoded; topics without any are left out.
    topics: HashMap<Arc<str>, usize>,
    /// How many messages have left: they are numbered as they come.
    left: usize,
    /// The number of the first message of each topic that is not too old.
    too_old: HashMap<&'static str, usize>,
    /// Whether there is a task at work.
    pub(super) at_work: bool,
}

impl Unencoded {
    /// Adds a message, or a series of them. Returns how many messages had to go for it.
    pub(super) fn push(&mut self, message: Deliver) -> u64 {
        self.bytes += message.frames.plain().len();
        *self.topics.entry(Arc::clone(&message.topic)).or_default() += 1;
        self.waiting.push_back(message);
        // Even the longest message has room.
        self.keep(MAX_TOPIC_BYTES + PLACE_BYTES)
    }

    /// Whether messages of this topic wait or are being encoded.
    pub(super) fn has(&self, topic: &str) -> bool {
        self.topics.contains_key(topic)
    }

    /// Drops the oldest until those that are left, and their places, take no more than `most` bytes; gives how many
    /// messages went.
    pub(super) fn keep(&mut self, most: usize) -> u64 {
        let mut dropped = 0;
        while self.bytes + self.waiting.len() * PLACE_BYTES > most
            && let Some(oldest) = self.pop()
        {
            self.end(&oldest.topic);
            dropped += series::messages(oldest.frames.plain().clone()).count() as u64;
        }
        dropped
    }

    /// How many messages wait, and their bytes.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.waiting.len(), self.bytes)
    }

    /// The messages of these topics have become too old, the one that is being encoded too: constant time, however many
    /// wait.
    pub(super) fn supersede(&mut self, topics: &[&'static str]) {
        if self.at_work {
            let next = self.left + self.waiting.len();
            self.too_old
                .extend(topics.iter().map(|topic| (*topic, next)));
        }
    }

    /// Notes that a message of this topic is dealt with.
    pub(super) fn end(&mut self, topic: &str) {
        if let Some(messages) = self.topics.get_mut(topic) {
            *messages -= 1;
            if *messages == 0 {
                self.topics.remove(topic);
            }
        }
    }

    /// The next message to be encoded, and its number; it is to [`end`](Self::end).
    pub(super) fn begin(&mut self) -> Option<(usize, Deliver)> {
        let number = self.left;
        Some((number, self.pop()?))
    }

    /// Whether the message of that number is still to be sent.
    pub(super) fn is_wanted(&self, number: usize, topic: &str) -> bool {
        self.too_old.get(topic).is_none_or(|&first| number >= first)
    }

    fn pop(&mut self) -> Option<Deliver> {
        let message = self.waiting.pop_front()?;
        self.bytes -= message.frames.plain().len();
        self.left += 1;
        Some(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actors::gateway::messages::Frames;

    fn message(length: usize) -> Deliver {
        Deliver {
            topic: "/t".into(),
            frames: Frames::Plain(vec![b'x'; length].into()),
            underway: None,
        }
    }

    #[test]
    fn the_longest_message_has_a_place_and_a_second_takes_it() {
        let mut unencoded = Unencoded::default();
        for dropped in [0, 1] {
            assert_eq!(unencoded.push(message(MAX_TOPIC_BYTES)), dropped);
            assert_eq!(unencoded.size(), (1, MAX_TOPIC_BYTES));
            assert!(unencoded.has("/t"));
        }
        assert_eq!(unencoded.keep(0), 1);
        assert!(!unencoded.has("/t"));
    }

    /// A client is not charged for places that are empty.
    #[test]
    fn the_places_go_with_the_messages() {
        let mut unencoded = Unencoded::default();
        for _ in 0..20_000 {
            unencoded.push(message(1));
        }
        for left in [1, 0] {
            while unencoded.size().0 > left {
                unencoded.pop();
            }
            let places = unencoded.waiting.places();
            assert!(places <= 128, "{places} for {left}");
        }
        const { assert!(size_of::<Deliver>() <= PLACE_BYTES) };
    }
}
