//! `throttle_rate` and `queue_length`: what one connection asked to have held back, topic by topic.
//!
//! Told the time; knows no clock. Used by the [outbox](crate::protocol::outbox) alone.
//!
//! **Invariant:** between two messages of a topic that are let go at least its interval passes, and of those held
//! back the newest remain.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

/// Entries of the two indexes that may be out of date before they are rebuilt, besides as many as are up to date.
const SLACK: usize = 32;

/// The throttles of one connection and what they hold back.
#[derive(Debug, Default)]
pub(super) struct Throttles {
    topics: HashMap<Arc<str>, TopicThrottle>,
    /// When the next message of a topic is due. Entries that no longer hold are skipped when they come up.
    releases: BinaryHeap<Reverse<(Instant, Arc<str>)>>,
    /// The messages that are held back, by age. Entries that no longer hold are skipped when they come up.
    ages: VecDeque<(u64, Arc<str>)>,
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
    /// Held back messages with their numbers, oldest first.
    held: VecDeque<(u64, Bytes)>,
}

impl TopicThrottle {
    /// When the next message may go; `None`: at once.
    fn next(&self) -> Option<Instant> {
        self.last.and_then(|last| last.checked_add(self.interval))
    }

    fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }

    /// Whether the message of that number is still held back. Numbers rise, and messages leave from the front.
    fn holds(&self, number: u64) -> bool {
        self.held
            .front()
            .is_some_and(|(oldest, _)| *oldest <= number)
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

    /// Bytes held back.
    pub(super) const fn bytes(&self) -> usize {
        self.bytes
    }

    /// How many messages are held back.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// Sets or lifts the throttle of a topic. Gives what was held back and now is not, oldest first.
    pub(super) fn set(
        &mut self,
        topic: &Arc<str>,
        throttle: Option<(Duration, usize)>,
    ) -> VecDeque<(u64, Bytes)> {
        let Some((interval, queue_length)) = throttle.filter(|(interval, _)| !interval.is_zero())
        else {
            return self.forget(topic);
        };
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
        while throttle.held.len() > queue_length {
            if let Some((_, frame)) = throttle.held.pop_front() {
                self.count -= 1;
                self.bytes -= frame.len();
            }
        }
        self.schedule(topic);
        self.tidy();
        VecDeque::new()
    }

    /// Lifts the throttle of a topic and gives what was held back, oldest first.
    pub(super) fn forget(&mut self, topic: &str) -> VecDeque<(u64, Bytes)> {
        let held = self
            .topics
            .remove(topic)
            .map(|throttle| throttle.held)
            .unwrap_or_default();
        self.count -= held.len();
        self.bytes -= held.iter().map(|(_, frame)| frame.len()).sum::<usize>();
        held
    }

    /// Discards what is held back of a topic; its throttle stays.
    pub(super) fn discard(&mut self, topic: &str) {
        if let Some(throttle) = self.topics.get_mut(topic) {
            self.count -= throttle.held.len();
            self.bytes -= throttle
                .held
                .drain(..)
                .map(|(_, frame)| frame.len())
                .sum::<usize>();
        }
    }

    /// A new message: given back if it may go at once, else held back, in place of the oldest of its topic if need be.
    pub(super) fn offer(
        &mut self,
        topic: &Arc<str>,
        number: u64,
        frame: Bytes,
        now: Instant,
    ) -> Option<Bytes> {
        let Some(throttle) = self.topics.get_mut(topic) else {
            return Some(frame);
        };
        if throttle.held.is_empty() && throttle.is_due(now) {
            throttle.last = Some(now);
            return Some(frame);
        }
        self.count += 1;
        self.bytes += frame.len();
        throttle.held.push_back((number, frame));
        let first = throttle.held.len() == 1;
        let full = throttle.held.len() > throttle.queue_length;
        if let Some((_, replaced)) = full.then(|| throttle.held.pop_front()).flatten() {
            self.count -= 1;
            self.bytes -= replaced.len();
        }
        self.ages.push_back((number, Arc::clone(topic)));
        if first {
            self.schedule(topic);
        }
        self.tidy();
        None
    }

    /// Lets go of one message whose time has come by `now`: those due first come first.
    pub(super) fn release(&mut self, now: Instant) -> Option<Bytes> {
        while self.next_release().is_some_and(|next| next <= now) {
            let Reverse((_, topic)) = self.releases.pop()?;
            let throttle = self.topics.get_mut(&topic)?;
            if let Some((_, frame)) = throttle.held.pop_front() {
                throttle.last = Some(now);
                self.count -= 1;
                self.bytes -= frame.len();
                self.schedule(&topic);
                return Some(frame);
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
    pub(super) fn oldest(&mut self) -> Option<u64> {
        while let Some((number, topic)) = self.ages.front() {
            if self
                .topics
                .get(topic)
                .is_some_and(|throttle| throttle.holds(*number))
            {
                return Some(*number);
            }
            self.ages.pop_front();
        }
        None
    }

    /// Drops the oldest message that is held back.
    pub(super) fn drop_oldest(&mut self) {
        if self.oldest().is_none() {
            return;
        }
        let Some((_, topic)) = self.ages.pop_front() else {
            return;
        };
        if let Some((_, frame)) = self
            .topics
            .get_mut(&topic)
            .and_then(|throttle| throttle.held.pop_front())
        {
            self.count -= 1;
            self.bytes -= frame.len();
        }
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

    /// Rebuilds an index once most of it is out of date: constant time per message, all told.
    fn tidy(&mut self) {
        if is_stale(self.ages.len(), self.count) {
            let topics = &self.topics;
            self.ages.retain(|(number, topic)| {
                topics
                    .get(topic)
                    .is_some_and(|throttle| throttle.holds(*number))
            });
        }
        if is_stale(self.releases.len(), self.topics.len()) {
            self.releases.clear();
            let waiting = self
                .topics
                .iter()
                .filter(|(_, throttle)| !throttle.held.is_empty());
            let due = waiting.filter_map(|(topic, throttle)| {
                throttle
                    .next()
                    .map(|next| Reverse((next, Arc::clone(topic))))
            });
            self.releases.extend(due);
        }
    }
}

/// Whether an index of so many entries is to be rebuilt, of which at most `valid` are up to date.
const fn is_stale(entries: usize, valid: usize) -> bool {
    entries > 2 * valid + SLACK
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_is_rebuilt_once_more_than_half_of_it_and_the_slack_is_out_of_date() {
        for valid in [0, 1, 10] {
            assert!(!is_stale(2 * valid + 32, valid));
            assert!(is_stale(2 * valid + 33, valid));
            assert!(is_stale(1000, valid));
        }
    }

    impl Throttles {
        fn check(&self) {
            let held = || self.topics.values().flat_map(|throttle| &throttle.held);
            assert_eq!(self.count, held().count());
            let bytes: usize = held().map(|(_, frame)| frame.len()).sum();
            assert_eq!(self.bytes, bytes);
        }
    }

    /// Setting one topic's throttle again and again has the index of dues rebuilt.
    #[test]
    fn what_is_due_is_known_after_its_index_was_rebuilt() {
        let [calm, busy] = ["/calm", "/busy"].map(Arc::<str>::from);
        let second = Duration::from_secs(1);
        let now = Instant::now();
        let mut throttles = Throttles::default();
        for topic in [&calm, &busy] {
            throttles.set(topic, Some((second, 1)));
            for number in 0..2 {
                let _ = throttles.offer(topic, number, Bytes::from_static(b"x"), now);
            }
        }
        for _ in 0..10 * SLACK {
            throttles.set(&busy, Some((second, 1)));
        }
        throttles.discard(&busy);
        assert_eq!(throttles.next_release(), Some(now + second));
        assert!(throttles.release(now + second).is_some());
        assert_eq!(throttles.next_release(), None);
    }

    /// Whichever way messages leave, what is counted is what is there.
    #[test]
    fn messages_and_their_bytes_are_counted_as_long_as_they_are_held_back() {
        let topics = ["/a", "/b"].map(Arc::<str>::from);
        let second = Duration::from_secs(1);
        let mut now = Instant::now();
        let mut throttles = Throttles::default();
        let fill = |throttles: &mut Throttles, first: u64, now| {
            for (number, topic) in (first..).zip((0..10).flat_map(|_| &topics)) {
                let frame = Bytes::from("x".repeat(1 + throttles.count));
                let _ = throttles.offer(topic, number, frame, now);
                throttles.check();
            }
        };
        for topic in &topics {
            throttles.set(topic, Some((second, 5)));
        }
        fill(&mut throttles, 0, now);
        assert_eq!(throttles.count, 10);
        throttles.set(&topics[0], Some((second, 2)));
        throttles.check();
        assert_eq!(throttles.count, 7);
        for _ in 0..3 {
            throttles.drop_oldest();
            throttles.check();
        }
        assert_eq!(throttles.count, 4);
        now += second;
        assert!(throttles.release(now).is_some());
        throttles.check();
        assert_eq!(throttles.count, 3);
        fill(&mut throttles, 100, now);
        throttles.discard(&topics[0]);
        throttles.check();
        assert_eq!(throttles.count, 5);
        assert_eq!(throttles.forget(&topics[1]).len(), 5);
        throttles.check();
        assert_eq!(throttles.count, 0);
    }

    /// One message is held back for a year, in front of all that comes after it in both indexes.
    #[test]
    fn the_indexes_stay_small_though_what_is_oldest_stays_for_long() {
        let mut throttles = Throttles::default();
        let (slow, fast) = (Arc::<str>::from("/slow"), Arc::<str>::from("/fast"));
        let mut now = Instant::now();
        let mut number = 0;
        let mut offer = |throttles: &mut Throttles, topic, now| {
            number += 1;
            throttles.offer(topic, number, Bytes::from_static(b"x"), now)
        };
        throttles.set(&slow, Some((Duration::from_secs(365 * 24 * 3600), 1)));
        throttles.set(&fast, Some((Duration::from_millis(1), 1)));
        for _ in 0..2 {
            offer(&mut throttles, &slow, now);
        }
        for round in 0..10_000 {
            offer(&mut throttles, &fast, now);
            offer(&mut throttles, &fast, now);
            match round % 4 {
                0 => throttles.discard(&fast),
                1 => drop(throttles.set(&fast, Some((Duration::from_millis(1), 1)))),
                2 => now += Duration::from_millis(2),
                _ => {}
            }
            let _ = throttles.release(now);
            let (ages, releases) = (throttles.ages.len(), throttles.releases.len());
            assert!(ages <= 2 * 3 + SLACK + 1, "{ages} ages");
            assert!(releases <= 2 * 2 + SLACK + 1, "{releases} releases");
        }
        assert_eq!(throttles.oldest(), Some(2));
    }
}
