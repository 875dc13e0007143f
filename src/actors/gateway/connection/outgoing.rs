//! The outgoing side of one client: its queue, the frames that are being written, and the deadline for the client
//! to take them.
//!
//! **Invariant:** the deadline expires only for a client that is finishing, or for which responses or a long message
//! have waited without a break.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;
use tokio::time::Instant;

use super::flow::{FRESH, FlowControl, UnreadSource};
use crate::actors::gateway::limits::{LINGER, STALL_LIMIT, WRITE_BYTES, WRITE_FRAMES};
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::{MAX_AGE, Outbox, Throttle};

/// The outgoing side of one client.
pub(super) struct Outgoing {
    outbox: Outbox,
    /// Whether each write has only one frame. Old clients, which end their frames without a newline, treat the bytes of
    /// one read as one frame.
    singly: bool,
    flow: FlowControl,
    gauges: Arc<Gauges>,
    /// Bytes of short responses in the outbox. The registry reads it.
    backlog: Arc<AtomicUsize>,
    /// Time when the frames being written left the outbox, or when the client last took bytes of them.
    progress: Instant,
    /// Start of the time in which responses have waited without a break.
    responses_since: Option<Instant>,
}

impl Outgoing {
    /// An empty outgoing side.
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
        }
    }

    /// Bytes of short responses in the outbox, shared with the registry.
    pub(super) fn backlog(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.backlog)
    }

    // ---- putting in -------------------------------------------------------------------------------------------------

    /// Adds a topic message, or a series of messages.
    pub(super) fn accept(&mut self, topic: Option<&Arc<str>>, frame: Bytes) {
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

    /// Adds a response or a status. Discards held-back messages on `superseded` topics, because they are older.
    pub(super) fn push_response(&mut self, frame: Bytes, superseded: &[&'static str]) {
        self.responses_since.get_or_insert_with(Instant::now);
        self.outbox.push_response(frame, superseded);
        self.note_backlog();
    }

    /// Sets the throttle of a topic, or removes the topic.
    pub(super) fn configure(&mut self, topic: &Arc<str>, throttle: Option<Throttle>) {
        self.outbox.configure(topic, throttle);
    }

    /// Sets whether each write has only one frame.
    pub(super) const fn set_singly(&mut self, singly: bool) {
        self.singly = singly;
    }

    // ---- taking out -------------------------------------------------------------------------------------------------

    /// The frames to write next.
    pub(super) fn frames(&self) -> impl ExactSizeIterator<Item = &Bytes> {
        self.outbox.writing()
    }

    /// Takes the next frames out of the outbox, if all previous ones were written. Returns whether there are frames to
    /// write. Nothing is held back from a client whose connection is finishing.
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

    /// Notes that `bytes` of the frames were written.
    pub(super) fn written(&mut self, bytes: usize) {
        self.progress = Instant::now();
        self.flow.note_written(bytes, self.progress);
        self.outbox.written(bytes);
        if self.responses_since.is_some() {
            self.note_backlog();
        }
        if self.outbox.response_bytes() == 0 {
            self.responses_since = None;
        }
    }

    fn note_backlog(&self) {
        let waiting = self.outbox.short_bytes();
        self.backlog.store(waiting, Ordering::Relaxed);
    }

    /// The earliest time of the next write, if nothing can be written now. Either a message is throttled, or the client
    /// must read first.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let release = self.outbox.next_release().map(Instant::from_std);
        let waits = self.outbox.has_topics() && !self.outbox.has_responses();
        let look = self.flow.next_look().filter(|_| waits);
        release.into_iter().chain(look).min()
    }

    /// Bytes of the unwritten responses.
    pub(super) const fn response_bytes(&self) -> usize {
        self.outbox.response_bytes()
    }

    /// Whether the client has read nothing for too long while a long message waits.
    pub(super) fn is_stuck(&self) -> bool {
        self.flow.age() > STALL_LIMIT && self.outbox.has_long()
    }

    /// The deadline of a client that takes no byte of a write. `None` if no response or long message waits, unless it
    /// is finishing. `taken` is the time when it last took a byte of the current write.
    pub(super) fn patience(&self, taken: Option<Instant>, is_finishing: bool) -> Option<Instant> {
        let last_byte = taken.map_or(self.progress, |taken| taken.max(self.progress));
        match self.responses_since {
            Some(since) => Some(since.max(last_byte) + STALL_LIMIT),
            None if is_finishing => Some(last_byte + LINGER),
            None => self.outbox.has_long().then(|| last_byte + STALL_LIMIT),
        }
    }
}
