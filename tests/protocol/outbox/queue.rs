//! The queue: in which order frames leave, and which messages are dropped when it is full.

use bytes::Bytes;
use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES, PLACE_BYTES};

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
    bench.outbox.push_feedback("2".into());
    bench.outbox.push_feedback("3".into());
    bench
        .outbox
        .push_feedback(vec![b'x'; MAX_TOPIC_BYTES + 1].into());
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

#[test]
fn the_oldest_topic_messages_go_first_when_the_queue_is_full() {
    let mut bench = Bench::new();
    let message = |tag: u8| Bytes::from(vec![tag; MIB]);
    for tag in 1..=6 {
        bench.push("/a", message(tag));
        bench.respond("answer", &[]);
    }
    assert_eq!(bench.outbox.dropped(), 2);
    let left: Vec<u8> = bench
        .take(usize::MAX, usize::MAX)
        .iter()
        .map(|frame| frame[0])
        .collect();
    assert_eq!(left, [b'a', b'a', 3, b'a', 4, b'a', 5, b'a', 6, b'a']);
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

#[test]
fn a_message_of_the_greatest_length_fits_and_a_longer_one_is_dropped_alone() {
    let mut bench = Bench::new();
    bench.push("/a", vec![0; MAX_TOPIC_BYTES - 1]);
    bench.push("/a", "1");
    assert_eq!(bench.outbox.topic_bytes(), MAX_TOPIC_BYTES);
    bench.push("/a", vec![0; MAX_TOPIC_BYTES + 1]);
    assert_eq!(
        (bench.outbox.dropped(), bench.outbox.topic_bytes()),
        (1, MAX_TOPIC_BYTES)
    );
    bench.push("/a", vec![0; MAX_TOPIC_BYTES]);
    assert_eq!(
        (bench.outbox.dropped(), bench.outbox.topic_bytes()),
        (3, MAX_TOPIC_BYTES)
    );
}

#[test]
fn the_longest_message_that_a_client_may_send_fits_with_its_newline() {
    let mut bench = Bench::new();
    bench.push("/a", vec![0; MAX_FRAME + 1]);
    assert_eq!(bench.outbox.dropped(), 0);
    assert_eq!(bench.take(1, usize::MAX).len(), 1);
}

#[test]
fn an_outbox_is_empty_when_neither_a_message_nor_a_response_can_be_taken() {
    let mut bench = Bench::new();
    assert!(bench.outbox.is_empty());
    bench.push("/a", "1");
    assert!(!bench.outbox.is_empty());
    bench.take_all();
    bench.respond("r", &[]);
    assert!(!bench.outbox.is_empty());
    bench.take_all();
    assert!(bench.outbox.is_empty());
}

#[test]
fn the_oldest_messages_go_until_those_that_are_left_fit_with_their_places() {
    let mut bench = Bench::new();
    bench.throttle("/held", 1000, 10);
    for topic in ["/t", "/held", "/held", "/t", "/t"] {
        bench.push(topic, vec![b'x'; 1000]);
    }
    bench.respond("response", &[]);
    // As it is charged: the message whole, and its place.
    let each = 1000 + FRAME_BYTES + PLACE_BYTES;
    let mut kept = |bytes| {
        bench.outbox.keep_topics(bytes);
        let outbox = &bench.outbox;
        assert_eq!(outbox.topic_bytes(), 1000 * outbox.topic_count());
        (outbox.topic_count(), outbox.dropped())
    };
    assert_eq!(kept(5 * each), (5, 0));
    assert_eq!(kept(5 * each - 1), (4, 1));
    assert_eq!(kept(2 * each), (2, 3));
    assert_eq!(kept(0), (0, 5));
    assert_eq!(bench.take_all(), ["response"], "which never goes");
}
