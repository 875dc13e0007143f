//! The queue: in which order frames leave, and which messages are dropped when it is full.

use bytes::Bytes;
use pendularm::protocol::limits::{MEDIUM, SHORT};
use pendularm::protocol::outbox::{MAX_MESSAGE, MAX_TOPIC_BYTES, MESSAGE_BYTES};

use super::{Bench, MIB};

#[test]
fn frames_leave_in_the_order_in_which_they_were_produced() {
    let mut bench = Bench::new();
    bench.push("/a", "1");
    bench.respond("2", &[]);
    bench.push("/b", "3");
    bench.push("/a", "4");
    bench.respond("5", &[]);
    assert!(!bench.outbox.is_empty());
    assert_eq!(bench.take_all(), ["1", "2", "3", "4", "5"]);
    assert!(bench.outbox.is_empty());
    assert!(bench.take_all().is_empty());
}

/// A topic may have the action's name.
#[test]
fn feedback_is_past_all_throttles_and_drops_nothing_if_it_cannot_fit() {
    let mut bench = Bench::new();
    bench.throttle("/a", 1000, 1);
    bench.push("/a", "1");
    bench.push("/a", "held back");
    bench.outbox.push_feedback("2".into(), bench.now);
    bench.outbox.push_feedback("3".into(), bench.now);
    bench
        .outbox
        .push_feedback(vec![b'x'; MAX_MESSAGE + 1].into(), bench.now);
    assert_eq!(bench.outbox.dropped(), 1);
    assert_eq!(bench.take_all(), ["1", "2", "3"]);
    bench.advance(1000);
    assert_eq!(bench.take_all(), ["held back"]);
}

#[test]
fn a_batch_is_limited_in_frames_and_bytes_but_never_empty() {
    let mut bench = Bench::new();
    for frame in ["aaa", "bbb", "ccc", "ddd", "eee"] {
        bench.push("/a", frame);
    }
    assert_eq!(bench.take(2, usize::MAX), ["aaa", "bbb"]);
    assert_eq!(bench.take(9, 7), ["ccc", "ddd"]);
    assert_eq!(bench.take(0, 0), ["eee"]);
}

/// As many of the longest short ones as fit with what each counts, and two more.
#[test]
fn the_oldest_topic_messages_go_first_when_the_queue_is_full() {
    let mut bench = Bench::new();
    let fit = MAX_TOPIC_BYTES / (SHORT + MESSAGE_BYTES);
    for tag in 1..=fit + 2 {
        bench.push("/a", vec![tag as u8; SHORT]);
        bench.respond("answer", &[]);
    }
    assert_eq!(bench.outbox.dropped(), 2);
    let mut left = bench.take(usize::MAX, usize::MAX);
    left.retain(|frame| frame.len() == SHORT);
    let left: Vec<usize> = left.iter().map(|frame| frame[0].into()).collect();
    assert!(left.into_iter().eq(3..=fit + 2));
}

/// Of those with room elsewhere one waits.
#[test]
fn the_newest_long_message_waits_and_one_that_no_client_may_send_is_dropped_alone() {
    let mut bench = Bench::new();
    for tag in 1..=4 {
        bench.push("/a", vec![tag; MAX_MESSAGE]);
    }
    bench.push("/a", vec![5; MAX_MESSAGE + 1]);
    bench.push("/a", "1");
    assert_eq!(bench.outbox.topic_bytes(), 1 + MEDIUM);
    assert_eq!(bench.outbox.dropped(), 4);
    let left = bench.take(usize::MAX, usize::MAX);
    assert_eq!((left.len(), left[0][0]), (2, 4));
}

#[test]
fn responses_are_never_dropped() {
    let mut bench = Bench::new();
    let answer = Bytes::from(vec![b'r'; MIB]);
    for _ in 0..100 {
        bench.outbox.push_response(answer.clone(), &[]);
    }
    bench.push("/a", vec![b'm'; 4 * MIB]);
    assert_eq!(bench.outbox.dropped(), 0);
    assert_eq!(bench.take(usize::MAX, usize::MAX).len(), 101);
}
