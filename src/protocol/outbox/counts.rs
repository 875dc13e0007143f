//! The numbers and bytes of the messages in an outbox, and a check of these sums.
//!
//! **Invariant:** the sums are those of the messages that wait, after every change.

use super::Outbox;
use super::message::Waiting;
use crate::protocol::limits::SHORT;

impl Outbox {
    /// Bytes of waiting responses, including those being written.
    #[must_use]
    pub const fn response_bytes(&self) -> usize {
        self.response_bytes
    }

    /// The same without responses that have a permit.
    #[must_use]
    pub const fn short_bytes(&self) -> usize {
        self.short_bytes
    }

    /// The number of waiting topic messages or series, including held ones.
    #[must_use]
    pub const fn topic_count(&self) -> usize {
        self.waiting.count
    }

    /// Counted bytes of waiting topic messages, including held ones.
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.waiting.bytes
    }

    /// Topic messages dropped so far because of the limits. A message that throttling replaces by a newer one
    /// is not counted.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Compares the sums with the messages. Builds without debug assertions omit it.
    pub(super) fn check_sums(&self) {
        if !cfg!(debug_assertions) {
            return;
        }
        let held = self.limits.values().flat_map(|limits| &limits.held);
        let mut waiting = Waiting::default();
        held.chain(&self.topics).for_each(|one| waiting.add(one));
        debug_assert_eq!(self.waiting, waiting);
        debug_assert!(self.kept_old <= self.topics.len());
        let queued = self.responses.iter();
        let queued = queued.map(|(_, frame)| (frame.len(), frame.len()));
        let writing = self.writing.iter().filter(|frame| frame.is_response);
        let writing = writing.map(|frame| (frame.rest.len(), frame.length));
        let responses = || queued.clone().chain(writing.clone());
        let short = responses().filter(|(_, length)| *length <= SHORT);
        debug_assert_eq!(self.short_bytes, short.map(|(rest, _)| rest).sum::<usize>());
        debug_assert_eq!(
            self.response_bytes,
            responses().map(|(rest, _)| rest).sum::<usize>()
        );
    }
}
