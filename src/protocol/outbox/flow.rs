//! Flow control by the bytes that a client has read. The caller passes the time, and a function for the unread bytes.
//!
//! Bytes in a client's socket get old, and cannot be dropped. The buffers of Linux hold 15 s of `/joint_states`. So a
//! client slower than its topics is sent only as much as it reads in `AHEAD`. The rest is dropped before it is
//! written. If a client's unread bytes are unknown, its socket's buffers are the only limit. A client that reads all
//! its bytes within `SLOW_AGE` is never delayed.
//!
//! **Invariant:** nothing is held back from a client whose unread bytes are unknown.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::protocol::outbox::MAX_AGE;

/// Returns the bytes that a client has not read, if that is known.
pub type UnreadSource = Box<dyn FnMut() -> Option<usize>>;

/// Nothing more is written once a byte has been unread for this time. Python reads 8 KiB at a time, which is half a
/// second of messages to a client that reads at half the rate.
const SLOW_AGE: Duration = Duration::from_millis(100);
/// A slow client is sent as much as it reads in this time.
const AHEAD: Duration = Duration::from_millis(200);
/// Largest age of a topic message ahead of a response, for a client that is far behind.
const FRESH: Duration = Duration::from_millis(200);
/// Time between two queries of the client's unread bytes: after a query that found none, after one that found some, and
/// while the client is slow. A query takes two system calls.
const QUERY_INTERVAL_IDLE: Duration = Duration::from_millis(300);
const QUERY_INTERVAL: Duration = Duration::from_millis(100);
const QUERY_INTERVAL_SLOW: Duration = Duration::from_millis(50);
/// A slow client that reads all bytes within this time gets twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// Window of the measured read rate. Also the time for which a client counts as slow.
const RATE_WINDOW: Duration = Duration::from_secs(1);
/// Bytes written within this time share one entry of the history.
const HISTORY_STEP: Duration = Duration::from_millis(20);
/// Most entries of the write history, which is 5 s of writing.
const MAX_HISTORY: usize = 256;

/// Counts bytes that were written to a client, and the bytes that it has read.
pub struct FlowControl {
    source: UnreadSource,
    /// Bytes written so far.
    written: u64,
    /// For each range of bytes that may be unread: its end, and the time when its first byte was written.
    history: VecDeque<(u64, Instant)>,
    /// The time and the bytes read so far, for each query of the last second.
    read: VecDeque<(Instant, u64)>,
    /// Time of the next query.
    next: Instant,
    /// The client counts as slow until this time.
    slow_until: Option<Instant>,
    /// Bytes that a slow client may have unread.
    window: u64,
    /// Bytes that may be written before the next query.
    room: u64,
    /// Age of the oldest unread byte at the last query.
    age: Duration,
}

impl FlowControl {
    /// The state of a client to which nothing was written.
    #[must_use]
    pub fn new(source: UnreadSource, now: Instant) -> Self {
        Self {
            source,
            written: 0,
            history: VecDeque::new(),
            read: VecDeque::new(),
            next: now,
            slow_until: None,
            window: 0,
            room: u64::MAX,
            age: Duration::ZERO,
        }
    }

    /// Notes that `bytes` have been written.
    pub fn note_written(&mut self, bytes: usize, now: Instant) {
        let bytes = bytes as u64;
        self.written += bytes;
        self.room = self.room.saturating_sub(bytes);
        let is_full = self.history.len() >= MAX_HISTORY;
        match self.history.back_mut() {
            Some((end, first)) if is_full || now < *first + HISTORY_STEP => *end = self.written,
            _ => self.history.push_back((self.written, now)),
        }
    }

    /// Bytes of topic messages that may be written now. A limit is updated at [`next_query`](Self::next_query).
    pub fn room(&mut self, now: Instant) -> usize {
        if now >= self.next {
            self.query(now);
        }
        usize::try_from(self.room).unwrap_or(usize::MAX)
    }

    /// Largest age of a topic message ahead of a response. It is smaller while the client still reads bytes that were
    /// written more than a second ago.
    #[must_use]
    pub fn max_age(&self) -> Duration {
        if self.age > MAX_AGE { FRESH } else { MAX_AGE }
    }

    /// Age of the oldest unread byte at the last query.
    #[must_use]
    pub const fn age(&self) -> Duration {
        self.age
    }

    /// The time of the next query, if nothing may be written before it.
    #[must_use]
    pub fn next_query(&self) -> Option<Instant> {
        (self.room == 0).then_some(self.next)
    }

    fn query(&mut self, now: Instant) {
        self.next = now + QUERY_INTERVAL;
        let Some(unread) = (self.source)() else {
            self.room = u64::MAX;
            return;
        };
        let unread = (unread as u64).min(self.written);
        let read = self.written - unread;
        let is_read = |stretch: &&(u64, Instant)| stretch.0 <= read;
        let count = self.history.iter().take_while(is_read).count();
        self.history.drain(..count);
        let oldest = self.history.front();
        let age = oldest.map_or(Duration::ZERO, |(_, first)| now.duration_since(*first));
        self.age = age;
        let is_old = |(time, _): &(Instant, u64)| now.duration_since(*time) > RATE_WINDOW;
        while self.read.front().is_some_and(is_old) {
            self.read.pop_front();
        }
        self.read.push_back((now, read));
        if age > SLOW_AGE {
            self.slow_until = Some(now + RATE_WINDOW);
            self.window = 0;
            self.room = 0;
        } else if self.slow_until.is_some_and(|until| now < until) {
            let doubled = if age < KEEPS_UP { 2 * self.window } else { 0 };
            self.window = doubled.max(self.bytes_ahead(now)).max(1);
            self.room = self.window.saturating_sub(unread);
        } else {
            self.slow_until = None;
            self.room = u64::MAX;
            if unread == 0 {
                self.next = now + QUERY_INTERVAL_IDLE;
            }
            return;
        }
        self.next = now + QUERY_INTERVAL_SLOW;
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
