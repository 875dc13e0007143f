//! The outgoing side of one client: its queue, the frames that are being written, and how long the client
//! may take for that.
//!
//! **Invariant:** patience ends only for a client that is finishing, or for which responses or a long message have
//! waited all the time.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::Bytes;
use tokio::time::Instant;

use super::unread::UnreadSource;
use crate::actors::gateway::limits::{LINGER, STALL_LIMIT, WRITE_BYTES, WRITE_FRAMES};
use crate::actors::node::Done;
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::{MAX_AGE, Outbox, Throttle};

/// The outgoing side of one client.
pub(super) struct Outgoing {
    outbox: Outbox,
    /// Whether each write has one frame only. Old clients, which end their frames with no newline, take what one read
    /// returns for one frame.
    singly: bool,
    flow: FlowControl,
    gauges: Arc<Gauges>,
    /// Bytes of short responses in the outbox, for the registry to look at.
    backlog: Arc<AtomicUsize>,
    /// When the frames that are being written were taken, or the client last took some of them.
    progress: Instant,
    /// The time since which responses have been waiting without a break.
    responses_since: Option<Instant>,
    /// Messages whose publishers wait until they have been offered to the socket.
    underway: Vec<Done>,
}

impl Outgoing {
    /// Nothing waits.
    pub(super) fn new(gauges: Arc<Gauges>, unread: UnreadSource) -> Self {
        let now = Instant::now();
        Self {
            outbox: Outbox::new(),
            singly: false,
            flow: FlowControl::new(unread, now),
            gauges,
            backlog: Arc::default(),
            progress: now,
            responses_since: None,
            underway: Vec::new(),
        }
    }

    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) fn backlog(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.backlog)
    }

    // ---- putting in -------------------------------------------------------------------------------------------------

    /// Adds a topic message, or a series of them.
    pub(super) fn accept(&mut self, topic: Option<&Arc<str>>, frame: Bytes, done: Option<Done>) {
        self.underway.extend(done);
        let now = Instant::now().into_std();
        self.counting_dropped(|outbox| match topic {
            Some(topic) => outbox.push(topic, frame, now),
            None => outbox.push_feedback(frame, now),
        });
    }

    fn counting_dropped(&mut self, act: impl FnOnce(&mut Outbox)) {
        let before = self.outbox.dropped();
        act(&mut self.outbox);
        let dropped = self.outbox.dropped() - before;
        if dropped > 0 {
            self.gauges.add_dropped(dropped);
        }
    }

    /// Adds a response or a status. Discards held-back messages on `superseded` topics: they are older.
    pub(super) fn push_response(&mut self, frame: Bytes, superseded: &[&'static str]) {
        self.responses_since.get_or_insert_with(Instant::now);
        self.outbox.push_response(frame, superseded);
    }

    /// Sets how a topic is throttled, or forgets the topic.
    pub(super) fn configure(&mut self, topic: &Arc<str>, throttle: Option<Throttle>) {
        self.outbox.configure(topic, throttle);
    }

    /// Whether each frame is written by itself.
    pub(super) const fn set_singly(&mut self, singly: bool) {
        self.singly = singly;
    }

    // ---- taking out -------------------------------------------------------------------------------------------------

    /// The frames that are to be written next.
    pub(super) fn frames(&self) -> impl ExactSizeIterator<Item = &Bytes> {
        self.outbox.writing()
    }

    /// Takes the next frames out of the outbox, if all before have been written. Whether there is something to write.
    /// Nothing is kept back from a client whose connection is finishing.
    pub(super) fn take(&mut self, is_finishing: bool) -> bool {
        if self.frames().len() == 0 {
            self.take_next(is_finishing);
        }
        self.frames().len() > 0
    }

    fn take_next(&mut self, is_finishing: bool) {
        let (has_topics, holds_back) = (self.outbox.has_topics(), self.outbox.holds_back());
        if self.outbox.is_empty() && !holds_back {
            return;
        }
        let now = Instant::now();
        let room = if is_finishing {
            usize::MAX
        } else if has_topics || holds_back {
            self.flow.room(now)
        } else {
            0
        };
        let most = if self.singly { 1 } else { WRITE_FRAMES };
        let is_far_behind = !is_finishing && self.flow.is_far_behind();
        let fresh = if is_far_behind { FRESH } else { MAX_AGE };
        self.counting_dropped(|outbox| {
            outbox.allow(room, fresh);
            outbox.take_frames(now.into_std(), most, WRITE_BYTES);
        });
        self.progress = now;
    }

    /// This many bytes of the frames have been written.
    pub(super) fn written(&mut self, bytes: usize) {
        self.progress = Instant::now();
        self.flow.note_written(bytes, self.progress);
        self.outbox.written(bytes);
        if self.outbox.response_bytes() == 0 {
            self.responses_since = None;
        }
    }

    /// When there may be something to write, if nothing is now: a message is held back, or the client has to read
    /// first.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let release = self.outbox.next_release().map(Instant::from_std);
        let waits = self.outbox.has_topics() && !self.outbox.has_responses();
        let look = self.flow.next_look().filter(|_| waits);
        release.into_iter().chain(look).min()
    }

    /// Bytes of the responses that have not been written.
    pub(super) const fn response_bytes(&self) -> usize {
        self.outbox.response_bytes()
    }

    /// Whether the client has read nothing for too long though a long message waits.
    pub(super) fn is_stuck(&self) -> bool {
        self.flow.age() > STALL_LIMIT && self.outbox.has_long()
    }

    /// The deadline of a client that takes no byte of a write; none while neither a response nor a long
    /// message waits and it is not finishing. `taken`: when it took some of a write that goes on.
    pub(super) fn patience(&self, taken: Option<Instant>, is_finishing: bool) -> Option<Instant> {
        let last_byte = taken.map_or(self.progress, |taken| taken.max(self.progress));
        match self.responses_since {
            Some(since) => Some(since.max(last_byte) + STALL_LIMIT),
            None if is_finishing => Some(last_byte + LINGER),
            None => self.outbox.has_long().then(|| last_byte + STALL_LIMIT),
        }
    }

    /// What the handlers have put in has been offered to the socket: publishers go on.
    pub(super) fn end_turn(&mut self) {
        let waiting = self.outbox.short_bytes();
        if self.backlog.load(Ordering::Relaxed) != waiting {
            self.backlog.store(waiting, Ordering::Relaxed);
        }
        self.underway.clear();
    }
}

// ---- flow control by the bytes that the client has read -------------------------------------------------------------
//
// Bytes in a client's socket get old, and can't be dropped any more. The size of a socket's buffers says nothing about
// time: the buffers of Linux hold 15 s of `/joint_states`. So a client that is slower than its topics is only written
// as much as it reads in `AHEAD`, and the rest is dropped before it is written. Where a client's unread bytes
// are unknown, its socket's buffers are the only bound. A client that reads all that it is sent within `HOLD` is never
// kept waiting.

/// Nothing more is written once a byte has been unread for this time. Python reads 8 KiB at a time: half a second of
/// messages to a client that takes half of them.
const HOLD: Duration = Duration::from_millis(100);
/// A slow client is written as much as it reads in that time.
const AHEAD: Duration = Duration::from_millis(200);
/// How old a topic message may be that a client which is far behind gets only because a response is behind it.
const FRESH: Duration = Duration::from_millis(200);
/// Time between two looks at the client's unread bytes: after a look that found none, after one that found some, and
/// while the client is slow. A look takes two calls of the system.
const ASK_CALM: Duration = Duration::from_millis(300);
const ASK: Duration = Duration::from_millis(100);
const ASK_SLOW: Duration = Duration::from_millis(50);
/// A client that reads all within that time keeps up: it is sent twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// How long the pace of reading is kept in mind, and how long a client counts as slow.
const MEMORY: Duration = Duration::from_secs(1);
/// Bytes that are written within this time count as written at once.
const GRAIN: Duration = Duration::from_millis(20);
/// Most entries of the history of writing: 5 s of it.
const MAX_HISTORY: usize = 256;

/// Counts bytes that were written to a client, and those that it has read.
struct FlowControl {
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
    fn new(source: UnreadSource, now: Instant) -> Self {
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
    fn note_written(&mut self, bytes: usize, now: Instant) {
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
    fn room(&mut self, now: Instant) -> usize {
        if now >= self.next {
            self.look(now);
        }
        usize::try_from(self.room).unwrap_or(usize::MAX)
    }

    /// Whether the client reads what was written more than a second ago.
    fn is_far_behind(&self) -> bool {
        self.age > MAX_AGE
    }

    /// How long ago the oldest byte was written that had not been read at the last look.
    const fn age(&self) -> Duration {
        self.age
    }

    /// When there may be room again, if there is none.
    fn next_look(&self) -> Option<Instant> {
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
            if unread == 0 {
                self.next = now + ASK_CALM;
            }
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
