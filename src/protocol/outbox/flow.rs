//! Flow control by the bytes that a client has read. The caller passes the time, and a function for the unread bytes.
//!
//! A client that pauses gets all that its socket's buffers hold, so nothing is held back from it. But bytes in a client's
//! socket get old, and cannot be dropped. So a client that reads more slowly than its topics publish (`slow.rs`) is sent
//! only as much as it reads in a short time. The rest is dropped before it is written. If a client's unread bytes are
//! unknown, its socket's buffers are the only limit.
//!
//! **Invariant:** nothing is held back from a client that is not slow, or whose unread bytes are unknown.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::slow::{SlowClient, UnreadQuery};
use super::{MAX_AGE, Room};

/// Returns the bytes that a client has not read, if that is known.
pub type UnreadSource = Box<dyn FnMut() -> Option<usize>>;

/// Largest age of a topic message ahead of a response, for a client that is far behind.
const FRESH: Duration = Duration::from_millis(200);
/// Time between two queries of the client's unread bytes: after a query that found none, after one that found some, and
/// while the client is slow. A query takes two system calls.
const QUERY_INTERVAL_IDLE: Duration = Duration::from_millis(300);
const QUERY_INTERVAL: Duration = Duration::from_millis(100);
const QUERY_INTERVAL_SLOW: Duration = Duration::from_millis(50);
/// Bytes written within this time share one entry of the history.
const HISTORY_STEP: Duration = Duration::from_millis(20);
/// Most entries of the write history, which is 5 s of writing. Beyond it, entries are longer.
const MAX_HISTORY: usize = 256;

/// Counts bytes that were written to a client, and the bytes that it has read.
pub struct FlowControl {
    source: UnreadSource,
    /// Bytes written so far.
    written: u64,
    /// Bytes read so far, at least. The system counts some unread bytes twice for a while.
    read: u64,
    /// For each range of bytes that may be unread: its end, and the time when its first byte was written.
    history: VecDeque<(u64, Instant)>,
    /// Time of the next query.
    next: Instant,
    slow: SlowClient,
    /// Bytes of topic messages that may be written before the next query.
    room: Room,
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
            read: 0,
            history: VecDeque::new(),
            next: now,
            slow: SlowClient::default(),
            room: Room::Unlimited,
            age: Duration::ZERO,
        }
    }

    /// Notes that `bytes` have been written.
    pub fn note_written(&mut self, bytes: usize, now: Instant) {
        self.written += bytes as u64;
        self.room.use_up(bytes);
        match self.history.back_mut() {
            Some((end, first)) if now < *first + HISTORY_STEP => *end = self.written,
            _ => self.history.push_back((self.written, now)),
        }
        if self.history.len() > MAX_HISTORY {
            self.shorten_history();
        }
    }

    /// Bytes of topic messages that may be written now. A limit is updated at [`next_query`](Self::next_query).
    pub fn room(&mut self, now: Instant) -> Room {
        if now >= self.next {
            self.query(now);
        }
        self.room
    }

    /// Largest age of a topic message ahead of a response. It is smaller while the client still reads bytes that were
    /// written more than a second ago.
    #[must_use]
    pub fn max_age(&self) -> Duration {
        if self.age > MAX_AGE { FRESH } else { MAX_AGE }
    }

    /// The time of the next query, if nothing may be written before it.
    #[must_use]
    pub fn next_query(&self) -> Option<Instant> {
        self.room.is_used_up().then_some(self.next)
    }

    /// Joins every two entries of the history.
    fn shorten_history(&mut self) {
        let mut first = None;
        self.history.retain_mut(|entry| match first.take() {
            None => {
                first = Some(entry.1);
                false
            }
            Some(first) => {
                entry.1 = first;
                true
            }
        });
        self.history
            .extend(first.map(|first| (self.written, first)));
    }

    fn query(&mut self, now: Instant) {
        let Some(unread) = (self.source)() else {
            (self.room, self.age) = (Room::Unlimited, Duration::ZERO);
            self.next = now + QUERY_INTERVAL;
            return;
        };
        self.read = self.read.max(self.written.saturating_sub(unread as u64));
        let read = self.read;
        let is_read = |stretch: &&(u64, Instant)| stretch.0 <= read;
        let count = self.history.iter().take_while(is_read).count();
        self.history.drain(..count);
        let oldest = self.history.front();
        self.age = oldest.map_or(Duration::ZERO, |(_, first)| now.duration_since(*first));
        let query = UnreadQuery {
            at: now,
            written: self.written,
            read,
            age: self.age,
        };
        let room = self.slow.room(query, self.room.is_used_up());
        self.room = room.map_or(Room::Unlimited, Room::Bytes);
        self.next = match room {
            Some(_) => now + QUERY_INTERVAL_SLOW,
            None if unread == 0 => now + QUERY_INTERVAL_IDLE,
            None => now + QUERY_INTERVAL,
        };
    }
}
