//! Topic messages that there is no room for, or that are wanted no more.
//!
//! **Invariant:** the oldest go first, whole; where they are many, somebody else frees them.

use std::collections::VecDeque;

use bytes::{Buf, Bytes};

use super::{FRAME_BYTES, MAX_TOPIC_BYTES, Outbox, PLACE_BYTES};
use crate::protocol::wire::series::first_messages;

/// Most messages that are freed where they are given up, which takes some tens of microseconds.
const FEW: usize = 256;

impl Outbox {
    /// Whether there is room for a message once all else has gone; if not, it counts as dropped.
    pub(super) fn may_fit(&mut self, frame: &Bytes) -> bool {
        let fits = frame.len() <= MAX_TOPIC_BYTES;
        self.dropped += u64::from(!fits);
        fits
    }

    pub(super) fn keep_bounded(&mut self) {
        self.drop_oldest(MAX_TOPIC_BYTES, 0);
    }

    /// Drops topic messages, the oldest first, until those that are left take at most so many bytes, their places
    /// included.
    pub fn keep_topics(&mut self, bytes: usize) {
        self.drop_oldest(bytes, PLACE_BYTES + FRAME_BYTES);
    }

    /// Moves out the topic messages that are wanted no more, if they are so many that freeing them takes long. Fewer
    /// are freed here.
    #[must_use]
    pub fn take_given_up(&mut self) -> Option<Vec<Bytes>> {
        if self.given_up.len() > FEW {
            return Some(std::mem::take(&mut self.given_up));
        }
        self.given_up.clear();
        self.given_up.shrink_to(1);
        None
    }

    pub(super) fn give_up(&mut self, held: VecDeque<(u64, Bytes)>) {
        self.given_up
            .extend(held.into_iter().map(|(_, frame)| frame));
    }

    /// Drops topic messages, the oldest first, until the rest costs at most `most` bytes, `place` of them for each
    /// message. The oldest is the queue's first or the one that was held back first. A series loses as many messages at
    /// once as have to go; held-back messages go at once as far as they are older than the queue's first.
    fn drop_oldest(&mut self, most: usize, place: usize) {
        loop {
            let cost = self.topic_bytes() + self.topic_count() * place;
            let mut excess = cost.saturating_sub(most);
            if excess == 0 {
                return;
            }
            let queued = self.topics.front().map_or(u64::MAX, |(number, _)| *number);
            if self.throttles.oldest().is_some_and(|held| held < queued) {
                let before = self.given_up.len();
                let goes = |bytes| {
                    let goes = excess > 0;
                    excess = excess.saturating_sub(bytes + place);
                    goes
                };
                let given_up = &mut self.given_up;
                self.throttles.give_up_oldest(queued, goes, given_up);
                self.dropped += (self.given_up.len() - before) as u64;
            } else if let Some((_, frames)) = self.topics.front_mut() {
                let (bytes, count) = first_messages(frames, excess);
                frames.advance(bytes);
                if frames.is_empty() {
                    let whole = self.topics.pop_front();
                    self.given_up.extend(whole.map(|(_, frame)| frame));
                }
                self.topic_bytes -= bytes;
                self.dropped += count as u64;
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
        }
    }
}
