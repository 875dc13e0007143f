//! A client's `throttle_rate` and `queue_length` of a topic, and the messages that are held back for that.
//!
//! **Invariant:** at least the interval lies between two released messages of a topic, and the newest messages are
//! held back.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::message::{QueuedMessage, counted};

/// How long a message of more than [`MEDIUM`](crate::protocol::limits::MEDIUM) may be held back: it takes room that
/// others wait for.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);

/// The throttling that a connection's subscriptions to one topic ask for together: the smallest of each value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Throttle {
    /// Least time between two deliveries; zero is no limit.
    pub interval: Duration,
    /// How many messages that may hold back, newest kept; at least 1.
    pub held_back: usize,
    /// How many messages may wait while the client does not take all that it is offered, newest kept, if a subscription
    /// limits that.
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

/// The messages of all topics that are held back: how many, and the bytes of them that count.
#[derive(Debug, Default)]
pub(super) struct HeldBack {
    pub(super) count: usize,
    pub(super) bytes: usize,
}

impl HeldBack {
    pub(super) fn add(&mut self, message: &QueuedMessage) {
        self.count += 1;
        self.bytes += counted(&message.frame);
    }

    pub(super) fn forget(&mut self, message: &QueuedMessage) {
        self.count -= 1;
        self.bytes -= counted(&message.frame);
    }
}

/// A client's limits of one topic.
#[derive(Debug)]
pub(super) struct TopicLimits {
    pub(super) throttle: Throttle,
    /// When the last message was released.
    pub(super) last: Option<Instant>,
    /// Messages that the throttle holds back.
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

    /// The number of the message that was held back first.
    pub(super) fn first_held(&self) -> Option<u64> {
        self.held.front().map(|held| held.number)
    }

    /// When the next message that is held back is due, if there is one.
    pub(super) fn due(&self) -> Option<Instant> {
        self.next().filter(|_| !self.held.is_empty())
    }

    /// Drops the oldest messages beyond the number that may be held back.
    pub(super) fn trim(&mut self, all: &mut HeldBack) {
        while self.held.len() > self.throttle.held_back
            && let Some(oldest) = self.held.pop_front()
        {
            all.forget(&oldest);
        }
    }

    /// When the next message may go; `None`: at once.
    fn next(&self) -> Option<Instant> {
        self.last?.checked_add(self.throttle.interval)
    }

    /// Whether a long message may wait for the next time.
    pub(super) fn may_hold_long(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now + MAX_HELD_BACK)
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }
}
