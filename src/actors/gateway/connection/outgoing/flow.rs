//! Flow control by the bytes that the client has read: bytes in its socket get old, and can't be dropped any
//! more.
//!
//! The size of a socket's buffers says nothing about time: the buffers of Linux hold 15 s of `/joint_states`. So a
//! client that is slower than its topics is only written as much as it reads in [`AHEAD`], and the rest is dropped
//! before it is written. Where nobody knows how much a client has not read, its socket's buffers are the only bound.
//!
//! **Invariant:** a client that reads all that it is sent within [`HOLD`] is never kept waiting, and nobody is asked
//! more often than every [`ASK`] about it.

use std::collections::VecDeque;
use std::time::Duration;

use tokio::time::Instant;

use crate::actors::gateway::connection::unread::UnreadSource;
use crate::protocol::outbox::MAX_AGE;

/// Nothing more is written once a byte has been unread for so long. Python reads 8 KiB at a time: half a second of
/// messages to a client that takes half of them.
const HOLD: Duration = Duration::from_millis(100);
/// A slow client is written as much as it reads in that time.
const AHEAD: Duration = Duration::from_millis(200);
/// How old a topic message may be that a client which is far behind gets only because a response is behind it.
pub(super) const FRESH: Duration = Duration::from_millis(200);
/// Time between two looks at what the client has not read, and the same while it is slow.
const ASK: Duration = Duration::from_millis(100);
const ASK_SLOW: Duration = Duration::from_millis(50);
/// A client that reads what it was sent within that time keeps up: it is sent twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// How long the pace of reading is kept in mind, and how long a client counts as slow.
const MEMORY: Duration = Duration::from_secs(1);
/// Bytes that are written within this time count as written at once.
const GRAIN: Duration = Duration::from_millis(20);
/// Most entries of the history of writing: 5 s of it.
const MAX_HISTORY: usize = 256;

/// Counts bytes that were written to a client, and those that it has read.
pub(super) struct FlowControl {
    source: UnreadSource,
    /// Bytes written so far.
    written: u64,
    /// For each stretch of bytes that may be unread: its end, and when its first byte was written.
    history: VecDeque<(u64, Instant)>,
    /// How many bytes had been read when it was looked at, over the last second.
    read: VecDeque<(Instant, u64)>,
    /// When the next look is due.
    next: Instant,
    /// Until when the client counts as slow.
    slow_until: Option<Instant>,
    /// Bytes that a slow client may have unread.
    window: u64,
    /// Bytes that may be written before the next look.
    room: u64,
    /// How long ago the oldest byte was written that had not been read at the last look.
    age: Duration,
}

impl FlowControl {
    pub(super) fn new(source: UnreadSource, now: Instant) -> Self {
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

    /// Notes that so many bytes have been written.
    pub(super) fn note_written(&mut self, bytes: usize, now: Instant) {
        let bytes = bytes as u64;
        self.written += bytes;
        if self.room < u64::MAX {
            self.room = self.room.saturating_sub(bytes);
        }
        let is_full = self.history.len() >= MAX_HISTORY;
        match self.history.back_mut() {
            Some((end, first)) if is_full || now < *first + GRAIN => *end = self.written,
            _ => self.history.push_back((self.written, now)),
        }
    }

    /// How many bytes of topic messages may be written now. If there is a limit it is looked at again at
    /// [`next_look`](Self::next_look).
    pub(super) fn room(&mut self, now: Instant) -> usize {
        if now >= self.next {
            self.look(now);
        }
        usize::try_from(self.room).unwrap_or(usize::MAX)
    }

    /// Whether the client reads what was written more than a second ago.
    pub(super) fn is_far_behind(&self) -> bool {
        self.age > MAX_AGE
    }

    /// How long ago the oldest byte was written that had not been read at the last look.
    pub(super) const fn age(&self) -> Duration {
        self.age
    }

    /// When there may be room again, if there is none.
    pub(super) fn next_look(&self) -> Option<Instant> {
        (self.room == 0).then_some(self.next)
    }

    fn look(&mut self, now: Instant) {
        self.next = now + ASK;
        let Some(unread) = (self.source)() else {
            self.room = u64::MAX;
            return;
        };
        let unread = (unread as u64).min(self.written);
        let read = self.written - unread;
        let is_read = |stretch: &&(u64, Instant)| stretch.0 <= read;
        let count = self.history.iter().take_while(is_read).count();
        self.history.drain(..count);
        let oldest = self.history.front().filter(|_| unread > 0);
        let age = oldest.map_or(Duration::ZERO, |(_, first)| now.duration_since(*first));
        self.age = age;
        let is_old = |(time, _): &(Instant, u64)| now.duration_since(*time) > MEMORY;
        while self.read.front().is_some_and(is_old) {
            self.read.pop_front();
        }
        self.read.push_back((now, read));
        if age > HOLD {
            self.slow_until = Some(now + MEMORY);
            self.window = 0;
            self.room = 0;
        } else if self.slow_until.is_some_and(|until| now < until) {
            let doubled = if age < KEEPS_UP { 2 * self.window } else { 0 };
            self.window = doubled.max(self.pace(now)).max(1);
            self.room = self.window.saturating_sub(unread);
        } else {
            self.slow_until = None;
            self.room = u64::MAX;
            return;
        }
        self.next = now + ASK_SLOW;
    }

    /// Bytes that the client reads in [`AHEAD`], by the last second.
    fn pace(&self, now: Instant) -> u64 {
        let (Some((since, first)), Some((_, last))) = (self.read.front(), self.read.back()) else {
            return 0;
        };
        let time = now.duration_since(*since).max(AHEAD).as_millis();
        let bytes = u128::from(last - first) * AHEAD.as_millis() / time;
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}
