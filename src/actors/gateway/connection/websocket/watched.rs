//! A WebSocket's stream, watched: for signs of life, and for what its other side has begun and not completed.
//!
//! **Invariant:** what is kept of unfinished messages, and what waits to be written, is charged to the client's
//! account.

use std::cell::Cell;
use std::io;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;

use super::heads::FrameHeads;
use crate::actors::gateway::connection::outgoing::Outgoing;
use crate::actors::gateway::connection::transport::CHUNK;
use crate::actors::gateway::connection::unfinished::Unfinished;
use crate::actors::gateway::limits::FRAME_TIME;
use crate::actors::resources::budget::Share;
use crate::protocol::limits::MAX_FRAME;

/// Buffer of a WebSocket for what comes in. It is there as long as the connection, so it is small.
pub(super) const READ_BUFFER: usize = 8 * 1024;
/// Bytes that are read before others have a turn: they may be ten thousand empty frames, of which no message comes.
const TURN: usize = 32 * 1024;

/// A stream that notes when its other side last gave a sign of life, and how much it has sent of a message that is not
/// complete. To send a byte is a sign of life, and so is to take one after a write found no room.
pub(super) struct Watched<S> {
    stream: S,
    /// Bytes that have come before, and are read first.
    behind: Bytes,
    life: Rc<Cell<Instant>>,
    /// Hears of every byte that the other side takes.
    outgoing: Rc<Outgoing>,
    /// Whether the last write found no room: the next that does find some is a sign of life.
    is_blocked: bool,
    unfinished: Unfinished,
    /// Bytes that belong to no complete message yet, or to one that has just been read.
    pending: usize,
    /// Follows the frames.
    heads: FrameHeads,
    /// The longest frame so far, if it was longer than what is read at a time: the WebSocket's buffer has grown to it,
    /// and stays so.
    longest: usize,
    /// Arrival time of the first byte of what is not complete, plus all time spent not reading.
    began: Option<Instant>,
    /// Whether the pending bytes belong to a message that has just been read.
    is_complete: bool,
    /// Bytes that wait to be written, and their buffer, which may be twice as long.
    unsent: Share,
    /// Bytes that may still be read before others have a turn, however many messages they are.
    turn: usize,
}

/// Bytes of a control frame beside its payload: two, and the mask's four.
const CONTROL_HEAD: usize = 6;
/// Bytes of a turn that a control frame counts as, beside its own: a ping is answered with a write of its own, which
/// takes longer than reading these.
const CONTROL_COST: usize = 1024;

impl<S> Watched<S> {
    /// A stream on which `behind` has come so far; `life` is when its other side last gave a sign of life.
    pub(super) fn new(
        stream: S,
        behind: Bytes,
        life: Rc<Cell<Instant>>,
        outgoing: Rc<Outgoing>,
        unfinished: Unfinished,
        unsent: Share,
    ) -> Self {
        let mut watched = Self {
            stream,
            behind,
            life,
            outgoing,
            is_blocked: false,
            unfinished,
            pending: 0,
            heads: FrameHeads::default(),
            longest: 0,
            began: None,
            is_complete: false,
            unsent,
            turn: TURN,
        };
        watched.set_pending(0);
        watched
    }

    /// Bytes have come.
    fn follow(&mut self, bytes: &[u8]) {
        let frame = usize::try_from(self.heads.follow(bytes)).unwrap_or(MAX_FRAME);
        if frame > READ_BUFFER {
            self.longest = self.longest.max(frame.min(MAX_FRAME));
        }
    }

    /// Begins another turn of reading. True if one was over: then whoever reads goes on without being woken.
    pub(super) const fn begin_turn(&mut self) -> bool {
        let is_over = self.is_turn_over();
        self.turn = TURN;
        is_over
    }

    /// Whether others have a turn now, though there may be more to be read.
    pub(super) const fn is_turn_over(&self) -> bool {
        self.turn == 0
    }

    /// Bytes that the library has to look at once their message has come, if it is a long one.
    pub(super) fn long(&self) -> Option<usize> {
        (self.pending > TURN).then_some(self.pending)
    }

    /// Notes that all of a message has been read; `left` bytes of it have not been dealt with.
    pub(super) fn complete(&mut self, left: usize) {
        self.is_complete = true;
        self.set_pending(left);
    }

    /// Reading goes on after so long a time: what was complete has been dealt with.
    pub(super) fn read_on(&mut self, unread: Duration) {
        self.began = self.began.map(|began| began + unread);
        if std::mem::take(&mut self.is_complete) {
            // The next message may have come with its end, in part.
            self.began = self.heads.is_within().then(Instant::now);
            self.set_pending(0);
        }
    }

    /// A control frame with so much payload has come: it may stand between the parts of a message.
    pub(super) fn control(&mut self, payload: usize) {
        self.turn = self.turn.saturating_sub(CONTROL_COST);
        self.set_pending(self.pending.saturating_sub(CONTROL_HEAD + payload));
    }

    /// Counts what is kept, now that `pending` bytes belong to no complete message.
    fn set_pending(&mut self, pending: usize) {
        self.pending = pending;
        if pending == 0 && !self.heads.is_within() {
            self.began = None;
        }
        // Input is kept twice, as it came and as a message. The heads of empty frames are part of neither, and are not
        // kept.
        let unfinished = (2 * pending).min(3 * MAX_FRAME);
        let behind = if self.behind.is_empty() { 0 } else { CHUNK };
        self.unfinished.keep(unfinished.max(self.longest) + behind);
    }

    /// When the message that has begun is late.
    pub(super) fn late(&self) -> Option<Instant> {
        self.began.map(|began| began + FRAME_TIME)
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        // No waker is needed: the reader itself begins the next turn.
        if self.is_turn_over() {
            return Poll::Pending;
        }
        let before = buffer.filled().len();
        let polled = if self.behind.is_empty() {
            Pin::new(&mut self.stream).poll_read(cx, buffer)
        } else {
            let length = self.behind.len().min(buffer.remaining());
            buffer.put_slice(&self.behind.split_to(length));
            if self.behind.is_empty() {
                // The memory is freed.
                self.behind = Bytes::new();
            }
            Poll::Ready(Ok(()))
        };
        let received = buffer.filled().len() - before;
        self.turn = self.turn.saturating_sub(received);
        if received > 0 {
            let now = Instant::now();
            self.life.set(now);
            self.began.get_or_insert(now);
            self.follow(buffer.filled().get(before..).unwrap_or_default());
            let pending = self.pending + received;
            self.set_pending(pending);
        }
        polled
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.stream).poll_write(cx, bytes);
        if polled.is_ready() && self.is_blocked {
            self.life.set(Instant::now());
        }
        self.is_blocked = polled.is_pending();
        let taken = match &polled {
            Poll::Ready(Ok(taken)) => *taken,
            _ => 0,
        };
        if taken > 0 {
            self.outgoing.note_taken();
        }
        let unsent = 2 * (bytes.len() - taken);
        if unsent != self.unsent.bytes() {
            self.unsent.resize(unsent);
        }
        polled
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
