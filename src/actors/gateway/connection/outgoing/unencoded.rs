//! Topic messages that have to be encoded before they can be sent.
//!
//! **Invariant:** at most [`MAX_TOPIC_BYTES`] wait, and the oldest are dropped.

use std::collections::HashMap;

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
    /// Messages that have left: they are numbered as they come.
    left: usize,
    /// By topic, the first message that is not too old.
    too_old: HashMap<&'static str, usize>,
    /// Whether there is a task at work.
    pub(super) at_work: bool,
}

impl Unencoded {
    /// Adds a message, or a series of them; gives how many messages had to go for it.
    pub(super) fn push(&mut self, message: Deliver) -> u64 {
        self.bytes += message.frames.plain().len();
        self.waiting.push_back(message);
        self.keep(MAX_TOPIC_BYTES)
    }

    /// Drops the oldest until those that are left, and their places, take no more than `most` bytes; gives how many
    /// messages went.
    pub(super) fn keep(&mut self, most: usize) -> u64 {
        let mut dropped = 0;
        while self.bytes + self.waiting.len() * PLACE_BYTES > most
            && let Some(oldest) = self.pop()
        {
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

    /// The next message to be encoded, and its number.
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
    use bytes::Bytes;

    use super::*;
    use crate::actors::gateway::messages::Frames;

    /// Nobody is charged for places that nothing takes.
    #[test]
    fn the_places_go_with_the_messages() {
        let mut unencoded = Unencoded::default();
        for _ in 0..20_000 {
            let message = Deliver {
                topic: "/t".into(),
                frames: Frames::Plain(Bytes::from_static(b"x")),
                underway: None,
            };
            unencoded.push(message);
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
