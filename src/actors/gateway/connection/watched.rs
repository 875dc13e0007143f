//! A WebSocket's stream, watched: for signs of life, for a message that takes too long, and for one that is long.
//!
//! **Invariant:** of a message that has no room nothing more is read than what needs none.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;

use crate::actors::gateway::limits::FRAME_TIME;
use crate::actors::resources::memory::{Memory, Permit};
use crate::protocol::limits::MEDIUM;

/// Input buffer of a WebSocket. It lives as long as the connection, so it is small.
pub(super) const READ_BUFFER: usize = 8 * 1024;
/// Bytes that are read before the reader yields. They may be ten thousand empty frames without a message.
const TURN: usize = 32 * 1024;
/// Longest head of a frame: two bytes, eight of a length, four of the mask.
const LONGEST_HEAD: usize = 14;
/// The lowest opcode of a control frame, which may come between the parts of a message.
const CONTROL: u8 = 8;
/// Bytes of a turn that a control frame counts as, beside its own: a ping is answered with a write of its own, which
/// takes longer than reading these.
const CONTROL_COST: usize = 1024;

/// The room for a long message, while it is waited for.
type ComingPermit = Pin<Box<dyn Future<Output = Permit>>>;

/// A stream that notes when its other side last gave a sign of life, and how much it has sent of a message that is not
/// complete. To send a byte is a sign of life, and so is to take one after a write found no room.
pub(super) struct MonitoredStream<S> {
    stream: S,
    /// Bytes that have come before, and are read first.
    behind: Bytes,
    /// When the other side last gave a sign of life.
    pub(super) life: Instant,
    /// When the other side last took a byte.
    pub(super) taken: Instant,
    /// Whether the last write found no room: the next that does find some is a sign of life.
    is_blocked: bool,
    /// The place in the message that comes.
    place: FramePlace,
    /// Arrival time of its first byte, plus all time spent not reading.
    began: Option<Instant>,
    /// Bytes that may still be read before the reader yields, in any number of messages.
    turn: usize,
    memory: Memory,
    /// The room for the message that comes, if it is long.
    pub(super) permit: Option<Permit>,
    waiting: Option<ComingPermit>,
}

impl<S> MonitoredStream<S> {
    /// A stream on which `behind` has come so far.
    pub(super) fn new(stream: S, behind: Bytes, memory: Memory) -> Self {
        let now = Instant::now();
        Self {
            stream,
            behind,
            life: now,
            taken: now,
            is_blocked: false,
            place: FramePlace::default(),
            began: None,
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

    /// Reading goes on after this time. Where `is_next`, the last message has been read.
    pub(super) fn read_on(&mut self, unread: Duration, is_next: bool) {
        self.began = self.began.map(|began| began + unread);
        if is_next && self.place.message <= MEDIUM {
            self.permit = None;
        }
    }

    /// A control frame has come.
    pub(super) const fn control(&mut self) {
        self.turn = self.turn.saturating_sub(CONTROL_COST);
    }

    /// When the message that has begun is late.
    pub(super) fn late(&self) -> Option<Instant> {
        self.began.map(|began| began + FRAME_TIME)
    }

    /// Waits until there is room for the message that comes, if it is long.
    fn poll_room(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        if self.place.message <= MEDIUM || self.permit.is_some() {
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

/// The place in a peer's frames (RFC 6455, section 5.2), by the bytes that have come. One read may bring the end of a
/// message and the beginning of the next.
#[derive(Default)]
struct FramePlace {
    /// The head of the present frame, as far as it has come.
    head: [u8; LONGEST_HEAD],
    /// Its bytes that have come.
    known: usize,
    /// Bytes of the frame's payload that are still to come.
    left: u64,
    /// Whether a message has begun that is not complete.
    is_open: bool,
    /// Its payload so far.
    message: usize,
}

impl FramePlace {
    const fn is_between_messages(&self) -> bool {
        self.known == 0 && !self.is_open
    }

    const fn is_control(&self) -> bool {
        self.head[0] & 0x0f >= CONTROL
    }

    /// Passes these bytes. Whether a message, or a control frame outside of one, ends among them.
    fn pass(&mut self, mut bytes: &[u8]) -> bool {
        let mut has_ended = false;
        while let Some((first, rest)) = bytes.split_first() {
            if self.left > 0 {
                let length = usize::try_from(self.left).unwrap_or(usize::MAX);
                let length = length.min(bytes.len());
                self.left -= length as u64;
                self.message += if self.is_control() { 0 } else { length };
                bytes = bytes.get(length..).unwrap_or_default();
            } else {
                if let Some(byte) = self.head.get_mut(self.known) {
                    *byte = *first;
                }
                self.known += 1;
                bytes = rest;
                let Some(length) = self.payload() else {
                    continue;
                };
                self.left = length;
                self.is_open |= !self.is_control();
            }
            if self.left == 0 {
                has_ended |= self.end_frame();
            }
        }
        has_ended
    }

    /// The length of the payload, once the head is complete.
    fn payload(&self) -> Option<u64> {
        let (_, extended) = self.head.split_at(2);
        let (bytes, length) = match self.head[1] & 0x7f {
            126 => (2, u64::from(u16::from_be_bytes(*extended.first_chunk()?))),
            127 => (8, u64::from_be_bytes(*extended.first_chunk()?)),
            short => (0, u64::from(short)),
        };
        let mask = if self.head[1] & 0x80 == 0 { 0 } else { 4 };
        (self.known >= 2 && self.known == 2 + bytes + mask).then_some(length)
    }

    /// The frame is complete. Whether no message is open now.
    const fn end_frame(&mut self) -> bool {
        self.known = 0;
        let is_last = self.head[0] & 0x80 != 0;
        if is_last && !self.is_control() {
            self.is_open = false;
            self.message = 0;
        }
        !self.is_open
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
            self.life = now;
            if self
                .place
                .pass(buffer.filled().get(before..).unwrap_or_default())
            {
                self.began = None;
            }
            if !self.place.is_between_messages() {
                self.began.get_or_insert(now);
            }
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
