//! Messages that wait for a long time, and queues of bounded length.

use std::sync::Arc;
use std::time::Duration;

use pendularm::protocol::outbox::{MAX_AGE, Throttle};

use super::Bench;

const AGE_MS: u64 = MAX_AGE.as_millis() as u64;

#[test]
fn a_message_older_than_a_second_is_dropped_unless_it_is_the_newest_of_its_topic() {
    let mut bench = Bench::new();
    for (topic, frame) in [("/a", "a1"), ("/b", "b1"), ("/a", "a2"), ("/a", "a3")] {
        bench.push(topic, frame);
    }
    bench.respond("r", &[]);
    bench.advance(AGE_MS - 1);
    assert_eq!(bench.take(1, usize::MAX), ["a1"]);
    bench.advance(1);
    assert_eq!(bench.take(1, usize::MAX), ["b1"]);
    assert_eq!(bench.outbox.dropped(), 0, "a second is not too long");
    bench.advance(1);
    assert_eq!(bench.take_all(), ["a3", "r"]);
    assert_eq!(bench.outbox.dropped(), 1);
    assert_eq!(bench.outbox.topic_bytes(), 0);
}

#[test]
fn an_old_message_is_removed_as_soon_as_its_topic_has_a_newer_one() {
    let mut bench = Bench::new();
    bench.push("/a", "a1");
    bench.push("/b", "b1");
    bench.advance(AGE_MS + 1);
    bench.push("/c", "c1");
    assert_eq!(bench.outbox.topic_count(), 3);
    bench.push("/a", "a2");
    assert_eq!((bench.outbox.dropped(), bench.outbox.topic_count()), (1, 3));
    assert_eq!(bench.take_all(), ["b1", "c1", "a2"]);
}

#[test]
fn of_an_old_series_the_newest_message_is_left() {
    let mut bench = Bench::new();
    let line = |n| format!("{{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{{\"n\":{n}}}}}\n");
    bench.push("/a", (1..4).map(line).collect::<String>());
    bench.advance(AGE_MS + 1);
    assert_eq!(bench.take_all(), [line(3)]);
    assert_eq!(bench.outbox.dropped(), 2);
}

#[test]
fn the_age_of_a_message_counts_from_its_release_by_the_throttle() {
    let mut bench = Bench::new();
    bench.throttle("/a", 5000, 2);
    for message in ["1", "2", "3"] {
        bench.push("/a", message);
    }
    assert_eq!(bench.take_all(), ["1"]);
    bench.advance(5000);
    assert_eq!(bench.take_all(), ["2"]);
    bench.advance(5000);
    assert_eq!(bench.take_all(), ["3"]);
    assert_eq!(bench.outbox.dropped(), 0);
}

#[test]
fn a_queue_length_bounds_the_queue_of_a_slow_client() {
    let topic: Arc<str> = "/a".into();
    let mut bench = Bench::new();
    let throttle = Throttle {
        queue_length: Some(2),
        ..Throttle::NONE
    };
    bench.outbox.configure(&topic, Some(throttle));
    for frame in ["1", "2", "3"] {
        bench.push("/a", frame);
    }
    // Nothing has been offered to the client yet: none of them is late.
    assert_eq!(bench.take(1, usize::MAX), ["1"]);
    for frame in ["4", "5"] {
        bench.push("/a", frame);
        bench.push("/b", frame);
    }
    assert_eq!(bench.outbox.dropped(), 2);
    bench.outbox.written(1);
    assert_eq!(bench.take_all(), ["4", "4", "5", "5"]);
}

#[test]
fn a_full_socket_takes_only_fresh_messages_ahead_of_a_response() {
    let mut bench = Bench::new();
    bench.push("/a", "old");
    bench.push("/b", "b");
    bench.advance(300);
    bench.push("/a", "a");
    bench.outbox.allow(0, Duration::from_millis(200));
    assert!(bench.take_all().is_empty());
    bench.respond("r", &[]);
    bench.push("/a", "behind");
    assert_eq!(bench.take_all(), ["b", "a", "r"]);
    bench.outbox.allow(1, Duration::ZERO);
    assert_eq!(bench.take_all(), ["behind"]);
}
