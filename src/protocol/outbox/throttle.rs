//! A client's `throttle_rate` and `queue_length` of a topic, and the held messages.
//!
//! **Invariant:** two released messages of a topic are at least the interval apart, and the newest messages are
//! held.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::message::{QueuedMessage, Waiting};

/// Longest time for which a message of more than [`MEDIUM`](crate::protocol::limits::MEDIUM) is held, because it
/// uses the shared pool.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);

/// The combined throttling of a connection's subscriptions to one topic: the smallest of each value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Throttle {
    /// Least time between two deliveries; zero means no limit.
    pub interval: Duration,
    /// Most messages that are held, the newest; at least 1.
    pub held_back: usize,
    /// Most messages that wait for a slow client, the newest, if a subscription limits them.
    pub queue_length: Option<usize>,
}

impl Throttle {
    /// No limit.
    pub const NONE: Self = Self {
        interval: Duration::ZERO,
        held_back: 1,
        queue_length: None,
    };
}

/// A client's limits of one topic.
#[derive(Debug)]
pub(super) struct TopicLimits {
    pub(super) throttle: Throttle,
    /// Time of the last released message.
    pub(super) last: Option<Instant>,
    /// The held messages.
    pub(super) held: VecDeque<QueuedMessage>,
}

impl Default for TopicLimits {
    fn default() -> Self {
        Self {
            throttle: Throttle::NONE,
            last: None,
            held: VecDeque::new(),
        }
    }
}

impl TopicLimits {
    /// Whether messages may be held back.
    pub(super) const fn holds_back(&self) -> bool {
        !self.throttle.interval.is_zero()
    }

    /// The number of the first held message.
    pub(super) fn first_held(&self) -> Option<u64> {
        self.held.front().map(|held| held.number)
    }

    /// When the next held message is due, if there is one.
    pub(super) fn due(&self) -> Option<Instant> {
        self.next().filter(|_| !self.held.is_empty())
    }

    /// Drops the oldest messages beyond the number that may be held back.
    pub(super) fn trim(&mut self, all: &mut Waiting) {
        while self.held.len() > self.throttle.held_back
            && let Some(oldest) = self.held.pop_front()
        {
            all.forget(&oldest);
        }
    }

    /// When the next message may be sent; `None` means at once.
    fn next(&self) -> Option<Instant> {
        self.last?.checked_add(self.throttle.interval)
    }

    /// Whether a long message may wait until the next release.
    pub(super) fn may_hold_long(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now + MAX_HELD_BACK)
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }
}
