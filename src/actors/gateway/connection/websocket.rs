//! WebSocket clients: a message is a frame. Pings and closes of the peer are answered. TCP keepalive detects a peer
//! whose machine is gone, as for every other client.
//!
//! **Invariant:** one poll receives a bounded number of bytes and of frames. A long message is read up to [`MEDIUM`]
//! bytes before it gets its memory permit.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use bytes::{Buf, Bytes};
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::error::{CapacityError, Error};
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::protocol::frame::{CloseFrame, Frame, Utf8Bytes};
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::turns::Turns;
use crate::actors::gateway::ends::ClientLost;
use crate::actors::gateway::limits::{FRAMES_IN_A_ROW, READ_BYTES};
use crate::actors::resources::memory::{Memory, Permit, SHORT};
use crate::protocol::limits::{MAX_FRAME, MEDIUM};
use crate::protocol::wire::frame::FrameError;

/// Input buffer of a WebSocket. It lives as long as the connection, so it is small.
const READ_BUFFER: usize = 8 * 1024;
/// Bytes of a control frame's header: two, and four of the mask.
const CONTROL_HEAD: usize = 6;
/// Bytes of payload in one WebSocket frame and in one write. A longer message is sent in fragments, so that the
/// client's progress is measurable.
const FRAGMENT: usize = 32 * 1024;
/// Most bytes that wait to be written: one write with its headers, and pongs. If a pong does not fit, one pong answers
/// all pings up to the latest one, as RFC 6455 allows (section 5.5.3).
const WRITE_BUFFER: usize = 2 * FRAGMENT;

/// A stream after the handshake.
pub(super) struct WebSocket<S> {
    socket: WebSocketStream<MonitoredStream<S>>,
    /// A long message, kept until the library reads again. Otherwise the library would keep its memory for reuse.
    spent: Option<Bytes>,
    /// The kind of the message that the next write continues, if there is one.
    unfinished: Option<Data>,
    /// Bytes of frames that the library has queued and not written.
    unflushed: usize,
    /// The close reason for the peer.
    close_reason: (CloseCode, &'static str),
    /// The close frame has been queued.
    is_closing: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin> WebSocket<S> {
    /// Takes a stream after the handshake. `behind` has the bytes received after it.
    pub(super) async fn open(stream: S, behind: Bytes, memory: Memory) -> Self {
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER)
            .write_buffer_size(FRAGMENT)
            .max_write_buffer_size(WRITE_BUFFER)
            .max_message_size(Some(MAX_FRAME))
            .max_frame_size(Some(MAX_FRAME));
        let watched = MonitoredStream::new(stream, memory);
        let (part, role) = (behind.into(), Role::Server);
        let socket = WebSocketStream::from_partially_read(watched, part, role, Some(config));
        Self {
            socket: socket.await,
            spent: None,
            unfinished: None,
            unflushed: 0,
            close_reason: (CloseCode::Away, "shutting down"),
            is_closing: false,
        }
    }

    fn stream(&mut self) -> &mut MonitoredStream<S> {
        self.socket.get_mut()
    }

    // ---- receiving --------------------------------------------------------------------------------------------------

    /// Waits for a message. A long one has its memory permit.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
    ) -> Poll<Result<(Bytes, Option<Permit>), ClientLost>> {
        let message = ready!(self.poll_message(cx))?;
        Poll::Ready(Ok((message, self.stream().end_message())))
    }

    fn poll_message(&mut self, cx: &mut Context<'_>) -> Poll<Result<Bytes, ClientLost>> {
        self.stream().left = READ_BYTES;
        for _ in 0..FRAMES_IN_A_ROW {
            let message = self.socket.poll_next_unpin(cx);
            self.spent = None;
            let message = match message {
                Poll::Ready(Some(Ok(Message::Text(text)))) => text.into(),
                Poll::Ready(Some(Ok(Message::Binary(bytes)))) => bytes,
                // The library answers pings and closes at the next read. It never returns raw frames.
                Poll::Ready(Some(Ok(control))) => {
                    self.stream().end_control(control.len());
                    continue;
                }
                // The peer has closed, and accepts no more answers.
                Poll::Ready(None) => return Poll::Ready(Err(ClientLost::Gone)),
                Poll::Ready(Some(Err(error))) => {
                    self.close_reason = close_reason(&error);
                    return Poll::Ready(Err(match error {
                        Error::Capacity(_) => {
                            ClientLost::Unreadable(FrameError::TooLong(MAX_FRAME))
                        }
                        Error::Utf8(_) => ClientLost::Unreadable(FrameError::NotText),
                        _ => ClientLost::Refused,
                    }));
                }
                Poll::Pending => return Poll::Pending,
            };
            self.spent = (message.len() > SHORT).then(|| message.clone());
            return Poll::Ready(Ok(message));
        }
        // Other connections have a turn.
        self.stream().turns.end(cx);
        Poll::Pending
    }

    /// Whether a message is incomplete.
    pub(super) fn is_unfinished(&self) -> bool {
        self.socket.get_ref().is_unfinished()
    }

    /// Whether a long message waits for its memory permit, so nothing is read.
    pub(super) fn waits_for_room(&self) -> bool {
        self.socket.get_ref().waiting.is_some()
    }

    /// Refuses the peer because of an incomplete message. The close frame has the reason `why`.
    pub(super) const fn refuse(&mut self, why: &'static str) {
        self.close_reason = (CloseCode::Policy, why);
    }

    /// The stream, to read from a refused peer.
    pub(super) fn refused_stream(&mut self) -> &mut MonitoredStream<S> {
        let stream = self.stream();
        stream.left = READ_BYTES;
        stream
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, which must stay the same until a call is ready. Returns the number of bytes.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl Iterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        // Otherwise waiting pongs would fill the buffer for the message.
        ready!(self.poll_flush(cx))?;
        if self.unflushed == 0 {
            self.unflushed = self.put_frames(frames)?;
            ready!(self.poll_flush(cx))?;
        }
        Poll::Ready(Ok(std::mem::take(&mut self.unflushed)))
    }

    fn put_frames<'a>(&mut self, frames: impl Iterator<Item = &'a Bytes>) -> io::Result<usize> {
        let mut written = 0;
        for frame in frames {
            let mut frame = frame.clone();
            while !frame.is_empty() {
                let room = FRAGMENT.saturating_sub(written);
                let kind = self.unfinished.unwrap_or_else(|| kind_of(&frame));
                let (piece, is_last) = first_piece(&frame, kind == Data::Text, room);
                if written > 0 && !is_last {
                    return Ok(written);
                }
                written += piece.len();
                frame.advance(piece.len());
                let opcode = match self.unfinished {
                    Some(_) => Data::Continue,
                    None => kind,
                };
                self.unfinished = (!is_last).then_some(kind);
                let payload = match piece.strip_suffix(b"\n") {
                    Some(line) if is_last && kind == Data::Text => piece.slice_ref(line),
                    _ => piece,
                };
                let part = Frame::message(payload, OpCode::Data(opcode), is_last);
                self.put(Message::Frame(part))?;
                if !is_last {
                    return Ok(written);
                }
            }
        }
        Ok(written)
    }

    /// Queues a message for the next flush.
    fn put(&mut self, message: Message) -> io::Result<()> {
        self.socket.start_send_unpin(message).map_err(gone)
    }

    /// Sends queued messages, and the answers to pings and closes.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.socket
            .poll_flush_unpin(cx)
            .map(|flushed| flushed.map_err(gone))
    }

    pub(super) fn last_taken(&self) -> Option<Instant> {
        Some(self.socket.get_ref().taken)
    }

    /// Closes in an orderly way. The input of a refused peer is discarded, including its close frame. The end of the
    /// stream is enough.
    pub(super) fn poll_end(
        &mut self,
        cx: &mut Context<'_>,
        is_refused: bool,
    ) -> Poll<io::Result<()>> {
        ready!(self.poll_flush(cx))?;
        if !self.is_closing {
            let (code, why) = self.close_reason;
            let reason = Utf8Bytes::from_static(why);
            self.put(Message::Close(Some(CloseFrame { code, reason })))?;
            self.is_closing = true;
            ready!(self.poll_flush(cx))?;
        }
        if is_refused {
            return Pin::new(self.stream()).poll_shutdown(cx);
        }
        Poll::Ready(Ok(()))
    }
}

fn gone(_: Error) -> io::Error {
    io::ErrorKind::ConnectionAborted.into()
}

/// The close reason for a peer that has violated a rule.
fn close_reason(error: &Error) -> (CloseCode, &'static str) {
    match error {
        Error::Capacity(CapacityError::MessageTooLong { .. }) => {
            (CloseCode::Size, "a message may have at most 4 MiB")
        }
        Error::Utf8(_) => (CloseCode::Invalid, "a text message must be UTF-8"),
        _ => (CloseCode::Protocol, "violates RFC 6455"),
    }
}

/// The kind of a frame: JSON begins with a brace, CBOR never does.
fn kind_of(frame: &Bytes) -> Data {
    if frame.first() == Some(&b'{') {
        Data::Text
    } else {
        Data::Binary
    }
}

/// The part of a frame that fits into one WebSocket frame, and whether a message ends there. A text may be several
/// messages, one per line.
fn first_piece(frame: &Bytes, is_text: bool, room: usize) -> (Bytes, bool) {
    let offered = frame.slice(..frame.len().min(room));
    if !is_text {
        let is_last = offered.len() == frame.len();
        return (offered, is_last);
    }
    match offered.iter().position(|&byte| byte == b'\n') {
        Some(end) => (offered.slice(..=end), true),
        None => (offered, false),
    }
}

// ---- the monitored stream: bytes that the peer takes, incomplete messages, and long messages ------------------------

/// Waits for the memory permit of a long message.
type PendingPermit = Pin<Box<dyn Future<Output = Permit>>>;

/// A stream that records when the peer last took a byte, and the bytes that the peer has sent of an incomplete message.
pub(super) struct MonitoredStream<S> {
    stream: S,
    /// Time when the peer last took a byte.
    taken: Instant,
    /// Bytes of the incoming message, read since the last complete message, without control frames.
    coming: usize,
    /// Bytes that may be read before other connections have a turn. They may be ten thousand empty frames without a
    /// message.
    left: usize,
    turns: Turns,
    memory: Memory,
    /// The memory permit of the incoming message, if it is long.
    permit: Option<Permit>,
    waiting: Option<PendingPermit>,
}

impl<S> MonitoredStream<S> {
    /// A stream without counted bytes.
    fn new(stream: S, memory: Memory) -> Self {
        Self {
            stream,
            taken: Instant::now(),
            coming: 0,
            left: READ_BYTES,
            turns: Turns::default(),
            memory,
            permit: None,
            waiting: None,
        }
    }

    /// Notes a complete message. Returns its memory permit, if it is long.
    fn end_message(&mut self) -> Option<Permit> {
        self.coming = 0;
        self.permit.take()
    }

    /// Notes a control frame with `payload` bytes. It may arrive between the parts of a message.
    fn end_control(&mut self, payload: usize) {
        self.coming = self.coming.saturating_sub(CONTROL_HEAD + payload);
    }

    /// Whether a message is incomplete.
    const fn is_unfinished(&self) -> bool {
        self.coming > 0
    }

    /// Waits for the memory permit of the incoming message, if it is long.
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
        if self.left == 0 {
            self.turns.end(cx);
            return Poll::Pending;
        }
        ready!(self.poll_room(cx));
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(cx, buffer);
        if polled.is_pending() {
            self.turns.rest();
        }
        let received = buffer.filled().len() - before;
        self.left = self.left.saturating_sub(received);
        self.coming += received;
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
