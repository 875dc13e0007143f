//! The outbox of one connection: messages that wait, are dropped, or are held back.
//!
//! **Invariant:** time is a parameter; no test waits.

mod costs;
mod pacing;
mod properties;
mod series;
mod steps;

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use pendularm::protocol::outbox::{Outbox, Throttle};

/// A throttle with this interval that holds back at most `held_back` messages.
fn throttle(interval: Duration, held_back: usize) -> Throttle {
    Throttle {
        interval,
        held_back,
        queue_length: None,
    }
}

/// An outbox under test, with a clock of its own.
struct Bench {
    outbox: Outbox,
    now: Instant,
}

impl Bench {
    fn new() -> Self {
        Self {
            outbox: Outbox::default(),
            now: Instant::now(),
        }
    }

    fn push(&mut self, topic: &str, frame: impl Into<Bytes>) {
        self.outbox.push(&Arc::from(topic), frame.into(), self.now);
    }

    fn respond(&mut self, frame: &'static str, supersedes: &[&str]) {
        self.outbox.push_response(Bytes::from(frame), supersedes);
    }

    fn throttle(&mut self, topic: &str, ms: u64, queue_length: usize) {
        let throttle = throttle(Duration::from_millis(ms), queue_length);
        self.outbox.configure(&Arc::from(topic), Some(throttle));
    }

    fn advance(&mut self, ms: u64) {
        self.now += Duration::from_millis(ms);
    }

    fn take(&mut self, max_frames: usize, max_bytes: usize) -> Vec<Bytes> {
        let before = self.outbox.writing().len();
        self.outbox.take_frames(self.now, max_frames, max_bytes);
        self.outbox.writing().skip(before).cloned().collect()
    }

    fn take_all(&mut self) -> Vec<String> {
        let text = |frame: &Bytes| String::from_utf8(frame.to_vec()).unwrap();
        self.take(usize::MAX, usize::MAX).iter().map(text).collect()
    }
}
