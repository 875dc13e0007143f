//! Throttled topics: the distance of their messages, and those that are held back.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use pendularm::protocol::outbox::{MAX_TOPIC_BYTES, MESSAGE_BYTES};

use super::Bench;

#[test]
fn a_throttled_topic_keeps_its_distance_and_the_newest_message() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 1);
    bench.push("/a", "1");
    assert_eq!(bench.take_all(), ["1"]);
    for frame in ["2", "3", "4"] {
        bench.advance(10);
        bench.push("/a", frame);
    }
    assert!(bench.outbox.is_empty());
    assert_eq!(
        bench.outbox.next_release(),
        Some(bench.now + Duration::from_millis(70))
    );
    bench.advance(69);
    assert!(bench.take_all().is_empty());
    bench.advance(1);
    assert_eq!(bench.take_all(), ["4"]);
    assert_eq!(bench.outbox.next_release(), None);
    assert_eq!(
        bench.outbox.dropped(),
        0,
        "what throttling replaces is not lost"
    );
}

#[test]
fn a_longer_queue_holds_back_that_many_and_lets_them_go_one_by_one() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    for frame in ["1", "2", "3", "4"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take_all(), ["1"]);
    bench.advance(100);
    assert_eq!(bench.take_all(), ["3"]);
    bench.advance(50);
    bench.push("/a", "5");
    bench.advance(50);
    assert_eq!(bench.take_all(), ["4"]);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["5"], "no burst after a long time");
}

#[test]
fn a_held_back_message_takes_its_place_when_its_time_comes() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 1);
    bench.push("/a", "a1");
    bench.push("/a", "a2");
    bench.push("/b", "b1");
    bench.advance(100);
    bench.push("/b", "b2");
    assert_eq!(bench.take_all(), ["a1", "b1", "a2", "b2"]);
}

#[test]
fn a_new_throttle_counts_from_the_last_delivery_and_lifting_it_lets_all_go() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 3);
    for frame in ["1", "2", "3", "4"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take_all(), ["1"]);
    bench.advance(50);
    bench.throttle("/a", 50, 2);
    assert_eq!(
        bench.take_all(),
        ["3"],
        "the smaller queue keeps the newest"
    );
    bench.push("/a", "5");
    bench.outbox.set_throttle(&Arc::from("/a"), None);
    assert_eq!(bench.take_all(), ["4", "5"]);
    bench.throttle("/a", 0, 1);
    bench.push("/a", "6");
    bench.push("/a", "7");
    assert_eq!(
        bench.take_all(),
        ["6", "7"],
        "no time at all is no throttle"
    );
}

#[test]
fn unsubscribing_discards_what_is_held_back_and_leaves_what_is_queued() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    for frame in ["1", "2", "3"] {
        bench.push("/a", frame);
    }
    bench.respond("r", &[]);
    bench.outbox.forget("/a");
    assert_eq!(bench.outbox.next_release(), None);
    assert_eq!(bench.outbox.topic_bytes(), 1);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["1", "r"]);
}

#[test]
fn a_response_discards_the_held_back_state_from_before_it() {
    let mut bench = Bench::new();
    bench.throttle("/a", 100, 2);
    bench.throttle("/b", 100, 2);
    for frame in ["1", "2"] {
        bench.push("/a", frame);
        bench.push("/b", frame);
    }
    bench.respond("paused", &["/a"]);
    assert_eq!(bench.take_all(), ["1", "1", "paused"]);
    bench.push("/a", "3");
    bench.advance(100);
    assert_eq!(
        bench.take_all(),
        ["3", "2"],
        "the distance is kept all the same"
    );
}

#[test]
fn held_back_messages_count_for_the_limit_and_go_when_they_are_the_oldest() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 100);
    // Seven of them fit.
    const LENGTH: usize = MAX_TOPIC_BYTES / 7 - MESSAGE_BYTES;
    let message = |tag: u8| Bytes::from(vec![tag; LENGTH]);
    bench.push("/a", message(0));
    assert_eq!(bench.take(1, usize::MAX).len(), 1);
    for (topic, tag) in ["/b", "/a", "/a", "/b", "/b", "/b", "/b"]
        .into_iter()
        .zip(1..)
    {
        bench.push(topic, message(tag));
    }
    assert_eq!(bench.outbox.topic_bytes(), 7 * LENGTH);
    bench.push("/b", message(8));
    bench.push("/b", message(9));
    assert_eq!(bench.outbox.dropped(), 2);
    let tags = |batch: Vec<Bytes>| -> Vec<u8> { batch.iter().map(|frame| frame[0]).collect() };
    let queued = tags(bench.take(usize::MAX, usize::MAX));
    assert_eq!(queued, [4, 5, 6, 7, 8, 9]);
    bench.advance(1000);
    assert_eq!(tags(bench.take(usize::MAX, usize::MAX)), [3]);
}
