//! A WebSocket's stream, watched: for signs of life, for a message that has begun, and for one that is long.
//!
//! **Invariant:** of a message that has no room nothing more is read than what needs none.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;

use crate::actors::resources::memory::{Memory, Permit};
use crate::protocol::limits::MEDIUM;

/// Input buffer of a WebSocket. It lives as long as the connection, so it is small.
pub(super) const READ_BUFFER: usize = 8 * 1024;
/// Bytes that are read before the reader yields. They may be ten thousand empty frames without a message.
const TURN: usize = 32 * 1024;
/// Bytes of the head of a control frame: two, and four of the mask.
const CONTROL_HEAD: usize = 6;
/// Bytes of a turn that a control frame counts as, beside its own: a ping is answered with a write of its own, which
/// takes longer than reading these.
const CONTROL_COST: usize = 1024;

/// The room for a long message, while it is waited for.
type ComingPermit = Pin<Box<dyn Future<Output = Permit>>>;

/// A stream that notes when its other side last gave a sign of life, and how much it has sent of a message that is not
/// complete. To send a byte is a sign of life, and so is to take one after a write found no room.
pub(super) struct MonitoredStream<S> {
    stream: S,
    /// When the other side last gave a sign of life.
    pub(super) life: Instant,
    /// When the other side last took a byte.
    pub(super) taken: Instant,
    /// Whether the last write found no room: the next that does find some is a sign of life.
    is_blocked: bool,
    /// Bytes that were read since the last message was complete, without control frames: the message that comes.
    coming: usize,
    /// Bytes that may still be read before the reader yields, in any number of messages.
    turn: usize,
    memory: Memory,
    /// The room for the message that comes, if it is long.
    permit: Option<Permit>,
    waiting: Option<ComingPermit>,
}

impl<S> MonitoredStream<S> {
    /// A stream of which no byte counts yet.
    pub(super) fn new(stream: S, memory: Memory) -> Self {
        let now = Instant::now();
        Self {
            stream,
            life: now,
            taken: now,
            is_blocked: false,
            coming: 0,
            turn: TURN,
            memory,
            permit: None,
            waiting: None,
        }
    }

    /// Begins another turn of reading.
    pub(super) const fn begin_turn(&mut self) {
        self.turn = TURN;
    }

    /// Whether the reader yields now, though there may be more to read.
    pub(super) const fn is_turn_over(&self) -> bool {
        self.turn == 0
    }

    /// A message is complete. Returns the room that it has taken, if it is long.
    pub(super) fn end_message(&mut self) -> Option<Permit> {
        self.coming = 0;
        self.permit.take()
    }

    /// A control frame with that many bytes has come. It may lie between the parts of a message.
    pub(super) fn end_control(&mut self, payload: usize) {
        self.turn = self.turn.saturating_sub(CONTROL_COST);
        self.coming = self.coming.saturating_sub(CONTROL_HEAD + payload);
    }

    /// Whether a message has begun and not ended.
    pub(super) const fn is_unfinished(&self) -> bool {
        self.coming > 0
    }

    /// Waits until there is room for the message that comes, if it is long.
    fn poll_room(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        if self.coming <= MEDIUM || self.permit.is_some() {
            return Poll::Ready(());
        }
        let waiting = self.waiting.get_or_insert_with(|| {
            let memory = self.memory.clone();
            Box::pin(async move { memory.long_frame().await })
        });
        let Poll::Ready(permit) = waiting.as_mut().poll(cx) else {
            return Poll::Pending;
        };
        self.waiting = None;
        self.permit = Some(permit);
        Poll::Ready(())
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for MonitoredStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        // No waker is needed: the reader itself begins the next turn.
        if self.is_turn_over() || self.poll_room(cx).is_pending() {
            return Poll::Pending;
        }
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(cx, buffer);
        let received = buffer.filled().len() - before;
        self.turn = self.turn.saturating_sub(received);
        if received > 0 {
            self.life = Instant::now();
            self.coming += received;
        }
        polled
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for MonitoredStream<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.stream).poll_write(cx, bytes);
        if polled.is_ready() && self.is_blocked {
            self.life = Instant::now();
        }
        self.is_blocked = polled.is_pending();
        if matches!(&polled, Poll::Ready(Ok(taken)) if *taken > 0) {
            self.taken = Instant::now();
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
