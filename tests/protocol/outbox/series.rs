//! Series of messages in an outbox.
//!
//! **Invariant:** a series is one frame to whoever takes several, and messages one by one to whoever takes one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::outbox::Outbox;

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
    outbox.take_frames(Instant::now(), max_frames, usize::MAX, &mut batch);
    batch
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
