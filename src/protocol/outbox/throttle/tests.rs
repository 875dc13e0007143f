//! Messages that are held back, and the memory that is kept beside them.
//!
//! **Invariant:** time is told, never waited for.

use super::*;

#[test]
fn an_index_is_rebuilt_once_more_than_half_of_it_and_the_slack_is_out_of_date() {
    for valid in [0, 1, 10] {
        assert!(!is_stale(2 * valid + 32, valid));
        assert!(is_stale(2 * valid + 33, valid));
        assert!(is_stale(1000, valid));
    }
}

fn message(number: u64, frame: impl Into<Bytes>) -> HeldMessage {
    HeldMessage {
        number,
        since: 0,
        frame: frame.into(),
    }
}

impl Throttles {
    /// Lets go of the next message that is due.
    fn release_one(&mut self, now: Instant) -> bool {
        self.release(now).is_some()
    }

    fn drop_one(&mut self) {
        let mut left = 1;
        let goes = |_| std::mem::take(&mut left) > 0;
        assert_eq!(self.give_up_oldest(u64::MAX, goes), 1);
    }

    fn check(&self) {
        let held = || self.topics.values().flat_map(|throttle| &throttle.held);
        assert_eq!(self.count, held().count());
        let bytes: usize = held().map(|held| held.frame.len()).sum();
        assert_eq!(self.bytes, bytes);
        let oldest = held().map(|held| held.number).min();
        assert_eq!(self.oldest(), oldest);
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
        throttles.set(topic, second, 1);
        for number in first..first + 2 {
            let _ = throttles.offer(topic, message(number, "x"), now);
        }
    }
    for _ in 0..10 * SLACK {
        throttles.set(&busy, second, 1);
    }
    throttles.discard(&busy);
    assert_eq!(throttles.next_release(), Some(now + second));
    assert!(throttles.release_one(now + second));
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
            let _ = throttles.offer(topic, message(number, frame), now);
            throttles.check();
        }
    };
    for topic in &topics {
        throttles.set(topic, second, 5);
    }
    fill(&mut throttles, 0, now);
    assert_eq!(throttles.count, 10);
    throttles.set(&topics[0], second, 2);
    throttles.check();
    assert_eq!(throttles.count, 7);
    for _ in 0..3 {
        throttles.drop_one();
        throttles.check();
    }
    assert_eq!(throttles.count, 4);
    now += second;
    assert!(throttles.release_one(now));
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

/// One message is held back for a year, in front of all that comes after it.
#[test]
fn the_index_stays_small_though_what_is_oldest_stays_for_long() {
    let mut throttles = Throttles::default();
    let (slow, fast) = (Arc::<str>::from("/slow"), Arc::<str>::from("/fast"));
    let mut now = Instant::now();
    let mut number = 0;
    let mut offer = |throttles: &mut Throttles, topic, now| {
        number += 1;
        throttles.offer(topic, message(number, "x"), now)
    };
    throttles.set(&slow, Duration::from_secs(365 * 24 * 3600), 1);
    throttles.set(&fast, Duration::from_millis(1), 1);
    for _ in 0..2 {
        offer(&mut throttles, &slow, now);
    }
    for round in 0..10_000 {
        offer(&mut throttles, &fast, now);
        offer(&mut throttles, &fast, now);
        match round % 4 {
            0 => drop(throttles.discard(&fast)),
            1 => throttles.set(&fast, Duration::from_millis(1), 1),
            2 => now += Duration::from_millis(2),
            _ => {}
        }
        let _ = throttles.release_one(now);
        assert!(throttles.releases.len() <= 2 * 2 + SLACK + 1);
    }
    assert_eq!(throttles.oldest(), Some(2));
}
