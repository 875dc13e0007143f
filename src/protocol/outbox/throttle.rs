//! `throttle_rate` and `queue_length`: what one connection asked to have held back, topic by topic.
//!
//! Told the time; knows no clock. Used by the [outbox](crate::protocol::outbox) alone.
//!
//! **Invariant:** between two messages of a topic that are let go at least its interval passes, and of those held
//! back the newest remain. Beside what is held back little memory is kept, however much was: nobody is charged for it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use crate::protocol::outbox::blocks::fit;

/// Dues that may be out of date before they are rebuilt, besides as many as are up to date.
const SLACK: usize = 32;

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
        for _ in queue_length..throttle.held.len() {
            self.pop(topic);
        }
        self.schedule(topic);
        self.tidy();
        VecDeque::new()
    }

    /// Lifts the throttle of a topic and gives what was held back, oldest first.
    pub(super) fn forget(&mut self, topic: &str) -> VecDeque<(u64, Bytes)> {
        let held = self.discard(topic);
        if self.topics.remove(topic).is_some() {
            self.topics.shrink_to(2 * self.topics.len());
            self.tidy();
        }
        held
    }

    /// Takes out what is held back of a topic, oldest first; its throttle stays.
    pub(super) fn discard(&mut self, topic: &str) -> VecDeque<(u64, Bytes)> {
        let throttle = self.topics.get_mut(topic);
        let held = throttle.map(|throttle| std::mem::take(&mut throttle.held));
        let held = held.unwrap_or_default();
        if let Some((oldest, _)) = held.front() {
            self.oldest.remove(oldest);
        }
        self.count -= held.len();
        self.bytes -= held.iter().map(|(_, frame)| frame.len()).sum::<usize>();
        held
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
        if throttle.held.len() == 1 {
            self.oldest.insert(number, Arc::clone(topic));
            self.schedule(topic);
            self.tidy();
        } else if throttle.held.len() > throttle.queue_length {
            self.pop(topic);
        }
        None
    }

    /// Lets go of one message whose time has come by `now`: those due first come first.
    pub(super) fn release(&mut self, now: Instant) -> Option<Bytes> {
        while self.next_release().is_some_and(|next| next <= now) {
            let Reverse((_, topic)) = self.releases.pop()?;
            if let Some(frame) = self.pop(&topic) {
                self.topics.get_mut(&topic)?.last = Some(now);
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
    pub(super) fn oldest(&self) -> Option<u64> {
        self.oldest.keys().next().copied()
    }

    /// Drops the oldest message that is held back.
    pub(super) fn drop_oldest(&mut self) {
        if let Some(topic) = self.oldest.values().next().cloned() {
            self.pop(&topic);
        }
    }

    /// Takes out the oldest message of a topic that is held back.
    fn pop(&mut self, topic: &Arc<str>) -> Option<Bytes> {
        let held = &mut self.topics.get_mut(topic)?.held;
        let (number, frame) = held.pop_front()?;
        fit(held);
        self.oldest.remove(&number);
        if let Some((next, _)) = held.front() {
            self.oldest.insert(*next, Arc::clone(topic));
        }
        self.count -= 1;
        self.bytes -= frame.len();
        Some(frame)
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
            let oldest = held().map(|(number, _)| *number).min();
            assert_eq!(self.oldest(), oldest);
            let places = |throttle: &TopicThrottle| throttle.held.capacity();
            let places: usize = self.topics.values().map(places).sum();
            assert!(places <= 2 * self.count + 4 * self.topics.len());
        }
    }

    /// Setting one topic's throttle again and again has the index of dues rebuilt.
    #[test]
    fn what_is_due_is_known_after_its_index_was_rebuilt() {
        let [calm, busy] = ["/calm", "/busy"].map(Arc::<str>::from);
        let second = Duration::from_secs(1);
        let now = Instant::now();
        let mut throttles = Throttles::default();
        for (first, topic) in [(0, &calm), (2, &busy)] {
            throttles.set(topic, Some((second, 1)));
            for number in first..first + 2 {
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

    /// Many are held back of one topic after the other; whatever has them go, none leaves its places behind.
    #[test]
    fn no_topic_keeps_the_places_of_what_was_held_back() {
        let topics: Vec<Arc<str>> = (0..100).map(|n| Arc::from(format!("/{n}"))).collect();
        let year = Duration::from_secs(365 * 24 * 3600);
        let now = Instant::now();
        let mut throttles = Throttles::default();
        for (n, topic) in (0..).zip(&topics) {
            throttles.set(topic, Some((year, 10_000)));
            for number in 1001 * n..1001 * (n + 1) {
                let _ = throttles.offer(topic, number, Bytes::from_static(b"x"), now);
            }
            match n % 3 {
                0 => (0..1000).for_each(|_| throttles.drop_oldest()),
                1 => drop(throttles.discard(topic)),
                _ => drop(throttles.set(topic, Some((year, 1)))),
            }
            throttles.check();
        }
        for topic in &topics {
            throttles.forget(topic);
        }
        throttles.check();
        assert!(throttles.topics.capacity() + throttles.releases.capacity() <= 3 * SLACK);
    }

    /// One message is held back for a year, in front of all that comes after it.
    #[test]
    fn the_index_stays_small_though_what_is_oldest_stays_for_long() {
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
                0 => drop(throttles.discard(&fast)),
                1 => drop(throttles.set(&fast, Some((Duration::from_millis(1), 1)))),
                2 => now += Duration::from_millis(2),
                _ => {}
            }
            let _ = throttles.release(now);
            assert!(throttles.releases.len() <= 2 * 2 + SLACK + 1);
        }
        assert_eq!(throttles.oldest(), Some(2));
    }
}
