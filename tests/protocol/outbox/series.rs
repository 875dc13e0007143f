//! Series of messages in an outbox: how they are taken, dropped, counted and throttled.
//!
//! **Invariant:** a series is one frame to a reader of several messages, and separate messages to a reader of one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::limits::SHORT;
use pendularm::protocol::outbox::{MAX_TOPIC_BYTES, MESSAGE_BYTES, Outbox, Throttle};

use super::{Bench, throttle};

/// A frame that publishes `msg` on `topic`.
fn line(topic: &str, msg: &str) -> String {
    format!("{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{msg}}}\n")
}

/// Adds messages of another topic up to the limit, less this many bytes and one more message.
fn fill(outbox: &mut Outbox, left: usize, now: Instant) {
    let mut bytes = MAX_TOPIC_BYTES - MESSAGE_BYTES - left;
    while bytes > 0 {
        let all = bytes - MESSAGE_BYTES;
        let length = if bytes > SHORT { SHORT / 2 } else { all };
        outbox.push(&"/other".into(), Bytes::from(vec![b' '; length]), now);
        bytes -= length + MESSAGE_BYTES;
    }
}

#[test]
fn a_series_is_taken_as_one_frame_where_several_are_asked_for() {
    let series = line("/a", "{}").repeat(2);
    let one = &series[..series.len() / 2];
    let next = Bytes::from_static(b"next");
    // A queue length takes it apart. Another topic's throttle does not.
    let queue_length = Some(9);
    let throttle = Throttle {
        queue_length,
        ..Throttle::NONE
    };
    for (throttled, most, parts) in [
        ("/b", 2, &[&*series, "next"][..]),
        ("/b", 1, &[one]),
        ("/a", 3, &[one, one, "next"]),
    ] {
        let mut bench = Bench::new();
        bench.outbox.configure(&throttled.into(), Some(throttle));
        bench.push("/a", series.clone());
        bench.push("/a", next.clone());
        let taken = bench.take(most, usize::MAX);
        assert_eq!(taken, parts);
        drop(bench);
        let is_alone = throttled == "/b" || taken[..2].iter().all(Bytes::is_unique);
        assert!(is_alone, "a part keeps the others in memory");
        let is_shared = most == 1 || taken.last().unwrap().as_ptr() == next.as_ptr();
        assert!(is_shared, "a single message is copied");
    }
}

#[test]
fn of_an_old_series_the_newest_message_is_left() {
    let numbered = |n: usize| line("/a", &format!("{{\"n\":{n}}}"));
    let mut bench = Bench::new();
    bench.push("/a", (1..4).map(numbered).collect::<String>());
    bench.advance(1001);
    assert_eq!(bench.take_all(), [numbered(3)]);
    assert_eq!(bench.outbox.dropped(), 2);
}

/// The same number is dropped and counted as with single messages.
#[test]
fn a_full_outbox_counts_what_it_drops_of_a_long_series() {
    let now = Instant::now();
    let topic: Arc<str> = "/x".into();
    let numbered = |n: usize| line("/x", &format!("{{\"n\":{n:06}}}"));
    let length = numbered(0).len();
    for kept in [
        0,
        1,
        length - 1,
        length,
        length + 1,
        500 * length,
        999 * length,
    ] {
        let mut outbox = Outbox::default();
        let series: String = (0..1000).map(numbered).collect();
        outbox.push(&topic, Bytes::from(series), now);
        fill(&mut outbox, kept, now);
        let left = kept / length;
        assert_eq!(outbox.dropped(), 1000 - left as u64, "{kept}");
        outbox.take_frames(now, 1, usize::MAX);
        let first = outbox.writing().next().unwrap();
        assert_eq!(left > 0, first == &numbered(1000 - left), "{kept}");
    }
}

#[test]
fn a_throttled_topic_keeps_as_many_of_a_series_as_its_queue_is_long() {
    let now = Instant::now();
    let topic: Arc<str> = "/x".into();
    let numbered = |n: usize| line("/x", &format!("{{\"n\":{n}}}"));
    for length in [1, 2, 8, 9, 10, 50] {
        let mut outbox = Outbox::default();
        outbox.configure(&topic, Some(throttle(Duration::from_millis(10), length)));
        for series in [0..10, 10..20] {
            let series: String = series.map(numbered).collect();
            outbox.push(&topic, Bytes::from(series), now);
        }
        for n in 0..30 {
            let later = now + n * Duration::from_millis(10);
            outbox.take_frames(later, 1, usize::MAX);
        }
        let batch: Vec<Bytes> = outbox.writing().cloned().collect();
        drop(outbox);
        assert!(batch.iter().all(Bytes::is_unique));
        let first = 20 - length.min(19);
        let wanted: Vec<String> = [0].into_iter().chain(first..20).map(numbered).collect();
        assert_eq!(batch, wanted, "{length}");
    }
}
