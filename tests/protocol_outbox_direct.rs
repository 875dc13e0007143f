//! An outbox whose messages go straight to the client where nothing stands in their way, and one whose room is scarce.
//!
//! **Invariant:** what stands in the way is tried one at a time: each alone is enough.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does"
)]

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::outbox::{MAX_TOPIC_BYTES, Outbox};

fn topic() -> Arc<str> {
    Arc::from("/a")
}

/// An outbox with these messages.
fn with(frames: &[&'static str]) -> Outbox {
    let mut outbox = Outbox::new();
    for frame in frames {
        outbox.push(
            &topic(),
            Bytes::from_static(frame.as_bytes()),
            Instant::now(),
        );
    }
    outbox
}

fn take(outbox: &mut Outbox, max_frames: usize) -> Vec<Bytes> {
    let mut batch = Vec::new();
    outbox.take_batch(Instant::now(), max_frames, usize::MAX, &mut batch);
    batch
}

/// What is ready to be written.
fn ready(outbox: &Outbox) -> Option<Vec<Bytes>> {
    outbox.ready().map(|frames| frames.cloned().collect())
}

#[test]
fn messages_are_ready_where_no_response_waits_nothing_is_being_written_and_nothing_is_throttled() {
    assert_eq!(
        ready(&with(&["1", "2"])),
        Some(vec!["1".into(), "2".into()])
    );
    assert_eq!(ready(&with(&[])), Some(vec![]));
    let mut responding = with(&["1"]);
    responding.push_response(Bytes::from_static(b"r"), &[]);
    assert_eq!(ready(&responding), None);
    let mut writing = with(&["1", "2"]);
    assert_eq!(take(&mut writing, 1), ["1"]);
    assert_eq!(ready(&writing), None);
    writing.written(1);
    assert_eq!(ready(&writing), Some(vec!["2".into()]));
    let mut throttled = with(&["1"]);
    throttled.set_throttle(&topic(), Some((Duration::from_secs(1), 1)));
    assert_eq!(ready(&throttled), None);
}

#[test]
fn an_outbox_is_idle_where_nothing_waits_nothing_is_being_written_and_nothing_is_throttled() {
    let mut outbox = with(&[]);
    assert!(outbox.is_idle());
    outbox.push(&topic(), Bytes::from_static(b"12"), Instant::now());
    assert!(!outbox.is_idle());
    assert_eq!(take(&mut outbox, 1), ["12"]);
    assert!(!outbox.is_idle());
    outbox.written(1);
    assert!(!outbox.is_idle());
    outbox.written(1);
    assert!(outbox.is_idle());
    assert!(!outbox.is_throttled());
    outbox.set_throttle(&topic(), Some((Duration::from_secs(1), 1)));
    assert!(!outbox.is_idle() && outbox.is_throttled());
    outbox.set_throttle(&topic(), None);
    assert!(outbox.is_idle() && !outbox.is_throttled());
}

#[test]
fn where_room_is_scarce_fewer_bytes_wait_from_the_next_message_on() {
    let mut outbox = with(&["12345", "67890"]);
    outbox.limit_topics(10);
    assert_eq!((outbox.topic_bytes(), outbox.dropped()), (10, 0));
    outbox.push(&topic(), Bytes::from_static(b"abc"), Instant::now());
    assert_eq!((outbox.topic_bytes(), outbox.dropped()), (8, 1));
    outbox.push(
        &topic(),
        Bytes::from_static(b"longer than ten"),
        Instant::now(),
    );
    assert_eq!((outbox.topic_bytes(), outbox.dropped()), (8, 2));
    // Plenty of room is the usual room, and no more than that.
    outbox.limit_topics(usize::MAX);
    let much = Bytes::from(vec![0; MAX_TOPIC_BYTES]);
    outbox.push(&topic(), much, Instant::now());
    assert_eq!(
        (outbox.topic_bytes(), outbox.dropped()),
        (MAX_TOPIC_BYTES, 4)
    );
    let more = Bytes::from(vec![0; MAX_TOPIC_BYTES + 1]);
    outbox.push(&topic(), more, Instant::now());
    assert_eq!(
        (outbox.topic_bytes(), outbox.dropped()),
        (MAX_TOPIC_BYTES, 5)
    );
}

#[test]
fn a_series_is_taken_as_one_frame_where_several_are_asked_for() {
    const SERIES: &str = "{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}\n{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}\n";
    let mut outbox = with(&[SERIES, "next"]);
    assert_eq!(take(&mut outbox, 2), [SERIES, "next"]);
    // Another topic's throttle does not take it apart.
    let mut outbox = Outbox::new();
    outbox.set_throttle(&Arc::from("/b"), Some((Duration::from_secs(1), 1)));
    outbox.push(
        &topic(),
        Bytes::from_static(SERIES.as_bytes()),
        Instant::now(),
    );
    assert_eq!(take(&mut outbox, 2), [SERIES]);
    let mut outbox = with(&[SERIES]);
    assert_eq!(take(&mut outbox, 1), [&SERIES[..SERIES.len() / 2]]);
}

#[test]
fn what_was_written_of_what_is_ready_is_gone_and_a_message_that_was_begun_comes_next() {
    const LINE: &str = "{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}\n";
    let series = || {
        let mut outbox = with(&["1"]);
        outbox.push(&topic(), Bytes::from(LINE.repeat(3)), Instant::now());
        outbox
    };
    // Up to the end of a message: nothing is begun, and the others may still be dropped.
    for (written, left) in [
        (0, 1 + 3 * LINE.len()),
        (1, 3 * LINE.len()),
        (1 + LINE.len(), 2 * LINE.len()),
    ] {
        let mut outbox = series();
        assert_eq!(outbox.taken(written), None);
        assert_eq!(outbox.topic_bytes(), left);
    }
    let mut outbox = series();
    assert_eq!(
        outbox.taken(1 + LINE.len() + 5).expect("the rest"),
        LINE[5..]
    );
    assert_eq!(outbox.topic_bytes(), LINE.len());
    assert_eq!(ready(&outbox), Some(vec![LINE.into()]));
    assert_eq!(outbox.taken(LINE.len()), None);
    assert!(outbox.is_empty());
}
