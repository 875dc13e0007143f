//! A client's `throttle_rate` and `queue_length` of a topic, and the messages that are held back for that.
//!
//! **Invariant:** at least the interval lies between two released messages of a topic, and the newest messages are
//! held back.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use bytes::Bytes;

/// How long a message of more than [`MEDIUM`](crate::protocol::limits::MEDIUM) may be held back: it takes room that
/// others wait for.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);

/// A client's limits of one topic.
#[derive(Debug, Default)]
pub(super) struct TopicLimits {
    /// How many messages may wait while the client does not take all that it is offered.
    pub(super) queue_length: Option<usize>,
    pub(super) throttle: Option<TopicThrottle>,
    /// Messages that the throttle holds back.
    pub(super) held: VecDeque<HeldMessage>,
}

/// The least time between two messages of a topic.
#[derive(Debug)]
pub(super) struct TopicThrottle {
    pub(super) interval: Duration,
    /// How many messages may be held back, 1 or more.
    pub(super) most_held: usize,
    /// When the last message was released.
    pub(super) last: Option<Instant>,
}

/// A message that is held back.
#[derive(Debug)]
pub(super) struct HeldMessage {
    pub(super) number: u64,
    /// When it was produced.
    pub(super) since: Instant,
    pub(super) frame: Bytes,
}

impl TopicLimits {
    /// Whether the client has asked for nothing.
    pub(super) const fn is_none(&self) -> bool {
        self.throttle.is_none() && self.queue_length.is_none()
    }

    /// The number of the message that was held back first.
    pub(super) fn first_held(&self) -> Option<u64> {
        self.held.front().map(|held| held.number)
    }

    /// When the next message that is held back is due, if there is one.
    pub(super) fn due(&self) -> Option<Instant> {
        let throttle = self.throttle.as_ref().filter(|_| !self.held.is_empty());
        throttle?.next()
    }

    /// Takes the oldest messages beyond the number that may be held back.
    pub(super) fn trim(&mut self) -> Vec<HeldMessage> {
        let most = self.throttle.as_ref().map_or(0, |one| one.most_held);
        let surplus = self.held.len().saturating_sub(most);
        self.held.drain(..surplus).collect()
    }
}

impl TopicThrottle {
    /// When the next message may go; `None`: at once.
    fn next(&self) -> Option<Instant> {
        self.last.and_then(|last| last.checked_add(self.interval))
    }

    /// Whether a long message may wait for the next time.
    pub(super) fn may_hold_long(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now + MAX_HELD_BACK)
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }
}
