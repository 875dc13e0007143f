//! Flow control by the bytes that a client has read. The caller passes the time, and a function for the unread bytes.
//!
//! A client that pauses gets all that its socket's buffers hold, so nothing is held back from it. But bytes in a client's
//! socket get old, and cannot be dropped. So a client that reads more slowly than its topics publish is sent
//! only as much as it reads in a short time. The rest is dropped before it is written. If a client's unread bytes are
//! unknown, its socket's buffers are the only limit.
//!
//! A client is slow if it reads again and again, always leaves bytes that were there before, and the oldest unread byte
//! does not get younger.
//!
//! **Invariant:** nothing is held back from a client that is not slow, or whose unread bytes are unknown. A client that
//! reads nothing is never slow. Neither is one that reads all waiting bytes whenever it reads.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

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
/// Least age of the oldest unread byte of a client that becomes slow, and least time between two compared reads.
const SLOW_AGE: Duration = Duration::from_millis(300);
/// A client is slow after this number of comparisons in a row, each of which shows that it has not caught up.
const SLOW_READS: u8 = 2;
/// A client that catches up makes the oldest unread byte younger by this part of the elapsed time, at least.
const CATCHING_UP: u32 = 4;
/// Time after which bytes that have been read are known to be, with the steps of the history.
const ACKNOWLEDGED: Duration = Duration::from_millis(60);
/// Nothing more is written to a slow client once a byte has been unread for this time.
const MAX_UNREAD_AGE: Duration = Duration::from_millis(100);
/// A slow client is sent as much as it reads in this time.
const AHEAD: Duration = Duration::from_millis(200);
/// A slow client that reads all bytes within this time gets twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// Window of the measured read rate.
const RATE_WINDOW: Duration = Duration::from_secs(1);
/// A slow client that has kept up for this time is no longer slow.
const RECOVERY: Duration = Duration::from_secs(3);

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

// ---- whether a client is slow --------------------------------------------------------------------------------------

/// A query of a client's unread bytes.
#[derive(Debug, Clone, Copy)]
struct UnreadQuery {
    at: Instant,
    /// Bytes written and bytes read so far.
    written: u64,
    read: u64,
    /// Age of the oldest unread byte.
    age: Duration,
}

impl UnreadQuery {
    const fn unread(&self) -> u64 {
        self.written - self.read
    }
}

/// Decides whether a client is slow, and paces it.
#[derive(Default)]
struct SlowClient {
    last: Option<UnreadQuery>,
    /// The last compared read that left bytes found by the query before it, since the client last read all of them.
    left: Option<UnreadQuery>,
    /// The comparisons in a row that show that it has not caught up.
    late_reads: u8,
    pace: Option<Pace>,
}

/// The pace of a slow client.
struct Pace {
    /// The client stops being slow at this time, unless it falls behind before.
    until: Instant,
    /// The time and the bytes read so far, for each query of the last second.
    read: VecDeque<(Instant, u64)>,
    /// Bytes that it may have unread.
    window: u64,
}

impl SlowClient {
    /// Bytes that may be written until the next query. `None` if the client is not slow. `is_used_up` is `true` if all
    /// bytes allowed before have been written.
    fn room(&mut self, query: UnreadQuery, is_used_up: bool) -> Option<u64> {
        let keeps_up = query.age <= MAX_UNREAD_AGE && !is_used_up;
        let is_over = |pace: &mut Pace| keeps_up && pace.until <= query.at;
        self.pace.take_if(is_over);
        if self.falls_behind(query) && self.pace.is_none() {
            self.pace = Some(Pace {
                until: query.at,
                read: VecDeque::new(),
                window: 0,
            });
        }
        let pace = self.pace.as_mut()?;
        if !keeps_up {
            pace.until = query.at + RECOVERY;
        }
        Some(pace.room(query))
    }

    /// Whether the client reads, but more slowly than bytes are written to it.
    fn falls_behind(&mut self, query: UnreadQuery) -> bool {
        let Some(before) = self.last.replace(query) else {
            return false;
        };
        let since = query.at.duration_since(before.at);
        if query.age <= since + ACKNOWLEDGED {
            (self.left, self.late_reads) = (None, 0);
        } else if query.read > before.read {
            self.compare(query);
        }
        self.late_reads >= SLOW_READS && query.age >= SLOW_AGE
    }

    /// Compares a read that left bytes with an earlier one.
    fn compare(&mut self, query: UnreadQuery) {
        let left = *self.left.get_or_insert(query);
        let elapsed = query.at.duration_since(left.at);
        if elapsed < SLOW_AGE {
            return;
        }
        self.left = Some(query);
        let catches_up = query.age + elapsed / CATCHING_UP < left.age;
        self.late_reads = match catches_up {
            true => 0,
            false => self.late_reads.saturating_add(1),
        };
    }
}

impl Pace {
    /// Bytes that may be written until the next query.
    fn room(&mut self, query: UnreadQuery) -> u64 {
        let is_old = |(time, _): &(Instant, u64)| query.at.duration_since(*time) > RATE_WINDOW;
        while self.read.front().is_some_and(is_old) {
            self.read.pop_front();
        }
        self.read.push_back((query.at, query.read));
        if query.age > MAX_UNREAD_AGE {
            self.window = 0;
            return 0;
        }
        let doubled = match query.age < KEEPS_UP {
            true => self.window.saturating_mul(2),
            false => 0,
        };
        self.window = doubled.max(self.bytes_ahead(query.at)).max(1);
        self.window.saturating_sub(query.unread())
    }

    /// Bytes that the client reads in [`AHEAD`], at its rate over the last second.
    fn bytes_ahead(&self, now: Instant) -> u64 {
        let (Some((since, first)), Some((_, last))) = (self.read.front(), self.read.back()) else {
            return 0;
        };
        let time = now.duration_since(*since).max(AHEAD).as_millis();
        let bytes = u128::from(last.saturating_sub(*first)) * AHEAD.as_millis() / time;
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}
