//! A client that is slower than its topics: when it counts as slow, and the bytes that it may then have unread.
//!
//! A client that pauses and then reads everything is not slow. A client is slow if it reads again and again, always
//! leaves bytes that were there before, and the oldest unread byte does not get younger.
//!
//! **Invariant:** a client that reads nothing is never slow. Neither is one that reads all waiting bytes whenever it
//! reads.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

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

/// A query of a client's unread bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnreadQuery {
    pub(super) at: Instant,
    /// Bytes written and bytes read so far.
    pub(super) written: u64,
    pub(super) read: u64,
    /// Age of the oldest unread byte.
    pub(super) age: Duration,
}

impl UnreadQuery {
    const fn unread(&self) -> u64 {
        self.written - self.read
    }
}

/// Decides whether a client is slow, and paces it.
#[derive(Default)]
pub(super) struct SlowClient {
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
    pub(super) fn room(&mut self, query: UnreadQuery, is_used_up: bool) -> Option<u64> {
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
