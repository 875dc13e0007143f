//! `throttle_rate` and `queue_length`: the messages that one connection asked to have held back,
//! topic by topic.
//!
//! It is told the time, and knows no clock. Only the [outbox](crate::protocol::outbox) uses it.
//!
//! **Invariant:** between two messages of a topic that are let go at least its interval passes, and of those held back
//! the newest remain.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use crate::protocol::limits::MEDIUM;
use crate::protocol::outbox::queues::{Timestamp, counted};

/// How long a message of more than [`MEDIUM`] may be held back: it takes room that others wait for.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);
/// Dues that may be out of date, beside as many as are up to date, before all are rebuilt.
const SLACK: usize = 32;

/// A message that is held back.
#[derive(Debug)]
pub(super) struct HeldMessage {
    pub(super) number: u64,
    /// When it was produced.
    pub(super) since: Timestamp,
    pub(super) frame: Bytes,
}

/// The throttles of one connection and what they hold back.
#[derive(Debug, Default)]
pub(super) struct Throttles {
    topics: HashMap<Arc<str>, TopicThrottle>,
    /// When the next message of a topic is due. Entries that no longer hold are skipped when they come up.
    releases: BinaryHeap<Reverse<(Instant, Arc<str>)>>,
    /// The topics of which messages are held back, by the number of the oldest.
    oldest: BTreeMap<u64, Arc<str>>,
    /// How many messages are held back.
    count: usize,
    /// Their size in bytes.
    bytes: usize,
}

/// The throttle of one topic.
#[derive(Debug)]
struct TopicThrottle {
    /// Least time between deliveries.
    interval: Duration,
    /// How many messages may be held back, 1 or more.
    queue_length: usize,
    /// When the last message was let go.
    last: Option<Instant>,
    /// Held back messages, oldest first.
    held: VecDeque<HeldMessage>,
}

impl TopicThrottle {
    /// When the next message may go; `None`: at once.
    fn next(&self) -> Option<Instant> {
        self.last.and_then(|last| last.checked_add(self.interval))
    }

    fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }
}

impl Throttles {
    /// Whether messages of that topic may be held back.
    pub(super) fn concerns(&self, topic: &str) -> bool {
        !self.topics.is_empty() && self.topics.contains_key(topic)
    }

    /// Whether there is no throttle at all, and so nothing held back.
    pub(super) fn is_empty(&self) -> bool {
        self.topics.is_empty()
    }

    /// How many messages of a topic may be held back.
    pub(super) fn queue_length(&self, topic: &str) -> usize {
        self.topics.get(topic).map_or(0, |one| one.queue_length)
    }

    /// Whether a message of the topic is a long one, and would be held back for longer than such may be.
    pub(super) fn holds_for_long(&self, topic: &str, frame: &Bytes, now: Instant) -> bool {
        let due = self.topics.get(topic).and_then(TopicThrottle::next);
        let is_long = frame.len() > MEDIUM;
        is_long && due.is_some_and(|due| due > now + MAX_HELD_BACK)
    }

    /// Bytes held back.
    pub(super) const fn bytes(&self) -> usize {
        self.bytes
    }

    /// How many messages are held back.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// Sets the throttle of a topic. Messages held back beyond `queue_length` are dropped.
    pub(super) fn set(&mut self, topic: &Arc<str>, interval: Duration, queue_length: usize) {
        let queue_length = queue_length.max(1);
        let throttle = self
            .topics
            .entry(Arc::clone(topic))
            .or_insert_with(|| TopicThrottle {
                interval,
                queue_length,
                last: None,
                held: VecDeque::new(),
            });
        throttle.interval = interval;
        throttle.queue_length = queue_length;
        let mut surplus = throttle.held.len().saturating_sub(queue_length);
        let goes = |_: &HeldMessage| {
            let goes = surplus > 0;
            surplus = surplus.saturating_sub(1);
            goes
        };
        self.give_up(topic, goes);
        self.schedule(topic);
        self.tidy();
    }

    /// Lifts the throttle of a topic and gives what was held back, oldest first.
    pub(super) fn forget(&mut self, topic: &str) -> VecDeque<HeldMessage> {
        let held = self.discard(topic);
        if self.topics.remove(topic).is_some() {
            self.topics.shrink_to(2 * self.topics.len());
            self.tidy();
        }
        held
    }

    /// Takes out what is held back of a topic, oldest first; its throttle stays.
    pub(super) fn discard(&mut self, topic: &str) -> VecDeque<HeldMessage> {
        let throttle = self.topics.get_mut(topic);
        let held = throttle.map(|throttle| std::mem::take(&mut throttle.held));
        let held = held.unwrap_or_default();
        if let Some(oldest) = held.front() {
            self.oldest.remove(&oldest.number);
        }
        self.count -= held.len();
        self.bytes -= held.iter().map(|held| counted(&held.frame)).sum::<usize>();
        held
    }

    /// Takes a new message, and gives it back if it may go at once. Otherwise it is held back, in place of the oldest
    /// of its topic if need be.
    pub(super) fn offer(
        &mut self,
        topic: &Arc<str>,
        message: HeldMessage,
        now: Instant,
    ) -> Option<HeldMessage> {
        let Some(throttle) = self.topics.get_mut(topic) else {
            return Some(message);
        };
        if throttle.held.is_empty() && throttle.is_due(now) {
            throttle.last = Some(now);
            return Some(message);
        }
        self.count += 1;
        self.bytes += counted(&message.frame);
        let number = message.number;
        throttle.held.push_back(message);
        if throttle.held.len() == 1 {
            self.oldest.insert(number, Arc::clone(topic));
            self.schedule(topic);
            self.tidy();
        } else if throttle.held.len() > throttle.queue_length {
            self.pop(topic);
        }
        None
    }

    /// Lets go of one message whose time has come by `now`, the one that was due first.
    pub(super) fn release(&mut self, now: Instant) -> Option<(Arc<str>, HeldMessage)> {
        while self.next_release().is_some_and(|next| next <= now) {
            let Reverse((_, topic)) = self.releases.pop()?;
            if let Some(message) = self.pop(&topic) {
                self.topics.get_mut(&topic)?.last = Some(now);
                self.schedule(&topic);
                return Some((topic, message));
            }
        }
        None
    }

    /// When the next held back message is due.
    pub(super) fn next_release(&mut self) -> Option<Instant> {
        while let Some(Reverse((due, topic))) = self.releases.peek() {
            let throttle = self
                .topics
                .get(topic)
                .filter(|throttle| !throttle.held.is_empty());
            if throttle.is_some_and(|throttle| throttle.next() == Some(*due)) {
                return Some(*due);
            }
            self.releases.pop();
        }
        None
    }

    /// The number of the oldest message that is held back.
    pub(super) fn oldest(&self) -> Option<u64> {
        self.oldest.keys().next().copied()
    }

    /// Drops the oldest messages of all, which are of one topic, as long as `goes` says so of the next one's bytes. It
    /// stops at the message with number `before`, and where another topic has an older one. Returns how many went.
    pub(super) fn give_up_oldest(
        &mut self,
        before: u64,
        mut goes: impl FnMut(usize) -> bool,
    ) -> u64 {
        let mut topics = self.oldest.iter();
        let Some((_, topic)) = topics.next() else {
            return 0;
        };
        let before = topics.next().map_or(before, |(next, _)| before.min(*next));
        let topic = Arc::clone(topic);
        let goes = |held: &HeldMessage| held.number < before && goes(counted(&held.frame));
        self.give_up(&topic, goes)
    }

    /// Drops messages of a topic that are held back, the oldest first, as long as `goes` says so of the next. Returns
    /// how many went.
    fn give_up(&mut self, topic: &Arc<str>, mut goes: impl FnMut(&HeldMessage) -> bool) -> u64 {
        let Some(TopicThrottle { held, .. }) = self.topics.get_mut(topic) else {
            return 0;
        };
        let count = held.iter().take_while(|held| goes(held)).count();
        let Some(oldest) = held.front().filter(|_| count > 0) else {
            return 0;
        };
        self.oldest.remove(&oldest.number);
        self.count -= count;
        for message in held.drain(..count) {
            self.bytes -= counted(&message.frame);
        }
        if let Some(next) = held.front() {
            self.oldest.insert(next.number, Arc::clone(topic));
        }
        count as u64
    }

    /// Takes out the oldest message of a topic that is held back.
    fn pop(&mut self, topic: &Arc<str>) -> Option<HeldMessage> {
        let held = &mut self.topics.get_mut(topic)?.held;
        let message = held.pop_front()?;
        self.oldest.remove(&message.number);
        if let Some(next) = held.front() {
            self.oldest.insert(next.number, Arc::clone(topic));
        }
        self.count -= 1;
        self.bytes -= counted(&message.frame);
        Some(message)
    }

    /// Notes when the topic's next held back message is due.
    fn schedule(&mut self, topic: &Arc<str>) {
        let throttle = self
            .topics
            .get(topic)
            .filter(|throttle| !throttle.held.is_empty());
        if let Some(next) = throttle.and_then(TopicThrottle::next) {
            self.releases.push(Reverse((next, Arc::clone(topic))));
        }
    }

    /// Rebuilds the dues once most of them are out of date, or most of their places empty: constant time per message,
    /// all told.
    fn tidy(&mut self) {
        let valid = self.topics.len();
        let most = 2 * valid + SLACK;
        if is_stale(self.releases.len(), valid) || is_stale(self.releases.capacity(), most) {
            let waiting = self
                .topics
                .iter()
                .filter(|(_, throttle)| !throttle.held.is_empty());
            let due = waiting.filter_map(|(topic, throttle)| {
                throttle
                    .next()
                    .map(|next| Reverse((next, Arc::clone(topic))))
            });
            self.releases = due.collect();
        }
    }
}

/// Whether an index of so many entries is to be rebuilt, of which at most `valid` are up to date.
const fn is_stale(entries: usize, valid: usize) -> bool {
    entries > 2 * valid + SLACK
}

#[cfg(test)]
mod tests;
