//! A client that is slower than its topics: its read rate, and the bytes that it may have unread.
//!
//! **Invariant:** a client that reads all its bytes within [`SLOW_AGE`] is never delayed.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Nothing more is written once a byte has been unread for this time. Python reads 8 KiB at a time, which is half a
/// second of messages to a client that reads at half the rate.
const SLOW_AGE: Duration = Duration::from_millis(100);
/// A slow client is sent as much as it reads in this time.
const AHEAD: Duration = Duration::from_millis(200);
/// A slow client that reads all bytes within this time gets twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// Window of the measured read rate. Also the time for which a client counts as slow.
const RATE_WINDOW: Duration = Duration::from_secs(1);

/// The read rate of a client, and whether it counts as slow.
#[derive(Default)]
pub(super) struct SlowClient {
    /// The time and the bytes read so far, for each query of the last second.
    read: VecDeque<(Instant, u64)>,
    /// The client counts as slow until this time.
    until: Option<Instant>,
    /// Bytes that a slow client may have unread.
    window: u64,
}

impl SlowClient {
    /// Bytes that may be written now. `None` if the client is not slow. It has read `read` bytes so far. The oldest of
    /// its `unread` bytes has the age `age`.
    pub(super) fn room(
        &mut self,
        now: Instant,
        age: Duration,
        read: u64,
        unread: u64,
    ) -> Option<u64> {
        let is_old = |(time, _): &(Instant, u64)| now.duration_since(*time) > RATE_WINDOW;
        while self.read.front().is_some_and(is_old) {
            self.read.pop_front();
        }
        self.read.push_back((now, read));
        if age > SLOW_AGE {
            self.until = Some(now + RATE_WINDOW);
            self.window = 0;
            return Some(0);
        }
        self.until = self.until.filter(|until| now < *until);
        self.until?;
        let doubled = if age < KEEPS_UP { 2 * self.window } else { 0 };
        self.window = doubled.max(self.bytes_ahead(now)).max(1);
        Some(self.window.saturating_sub(unread))
    }

    /// Bytes that the client reads in [`AHEAD`], at its rate over the last second.
    fn bytes_ahead(&self, now: Instant) -> u64 {
        let (Some((since, first)), Some((_, last))) = (self.read.front(), self.read.back()) else {
            return 0;
        };
        let time = now.duration_since(*since).max(AHEAD).as_millis();
        let bytes = u128::from(last - first) * AHEAD.as_millis() / time;
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}
