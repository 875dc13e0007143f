//! WebSocket clients: a message is a frame. The rest of the protocol is done here: a peer that shows no sign of life is
//! given up.
//!
//! **Invariant:** one poll receives a bounded number of bytes, since one read may bring a thousand pings, each of which
//! is answered.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use bytes::{Buf, Bytes, BytesMut};
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::error::{CapacityError, Error};
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::protocol::frame::{CloseFrame, Frame, Utf8Bytes};
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::plain::{self, CHUNK, ClientLost};
use super::timer::Timer;
use super::watched::{MonitoredStream, READ_BUFFER};
use crate::actors::resources::memory::{Memory, Permit, SHORT};
use crate::protocol::limits::MAX_FRAME;

/// Ping interval: below the idle timeouts of NATs and proxies.
const PING_INTERVAL: Duration = Duration::from_secs(15);
/// How long a peer that was asked may be silent. Any byte that it sends or takes counts, not only the pong, which can
/// be far behind in a full pipe.
const PONG_TIME: Duration = Duration::from_secs(30);
/// Bytes of payload in one WebSocket frame and in one write; a longer message goes in fragments, so that a client is
/// seen to take it.
const FRAGMENT: usize = 32 * 1024;
/// Most bytes that wait to be written: a write of ours with its heads, and pongs. Where a pong finds no room, one
/// answers all the pings up to the last that has come, as RFC 6455 has it (section 5.5.3).
const WRITE_BUFFER: usize = 2 * FRAGMENT;

/// A stream on which the handshake has been made.
pub(super) struct WebSocket<S> {
    socket: WebSocketStream<MonitoredStream<S>>,
    timer: Timer,
    next_ping: Instant,
    /// Whether the peer is to be asked for a sign of life.
    ping_is_due: bool,
    /// The time since which a sign of life has been waited for.
    asked: Option<Instant>,
    /// When the last read ended; none while one is under way.
    unread_since: Option<Instant>,
    /// A long message, kept until the library reads on: it would keep the memory of one that is gone for the next.
    spent: Option<Bytes>,
    /// The kind of the message that the next write continues, if it does not begin one.
    unfinished: Option<Data>,
    /// Bytes of frames that the library has taken and not written.
    underway: usize,
    /// The reason for the end of the connection, for the peer.
    close_reason: (CloseCode, &'static str),
    /// The close frame has been put behind all else.
    is_closing: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin> WebSocket<S> {
    /// Takes a stream on which the handshake has been made; `behind` came after it.
    pub(super) async fn open(stream: S, behind: Bytes, memory: Memory) -> Self {
        let now = Instant::now();
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
            timer: Timer::default(),
            next_ping: now + PING_INTERVAL,
            ping_is_due: false,
            asked: None,
            unread_since: Some(now),
            spent: None,
            unfinished: None,
            underway: 0,
            close_reason: (CloseCode::Away, "shutting down"),
            is_closing: false,
        }
    }

    fn stream(&mut self) -> &mut MonitoredStream<S> {
        self.socket.get_mut()
    }

    // ---- receiving --------------------------------------------------------------------------------------------------

    pub(super) fn begin_turn(&mut self) {
        self.stream().begin_turn();
    }

    /// Waits for a message. With a long one comes the room that it takes.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
    ) -> Poll<Result<(Bytes, Option<Permit>), ClientLost>> {
        // While nothing was read, no sign of life could be seen.
        let unread = self.unread_since.take();
        let unread = unread.map_or(Duration::ZERO, |since| since.elapsed());
        self.asked = self.asked.map(|asked| asked + unread);
        let message = ready!(self.poll_message(cx))?;
        self.unread_since = Some(Instant::now());
        Poll::Ready(Ok((message, self.stream().end_message())))
    }

    fn poll_message(&mut self, cx: &mut Context<'_>) -> Poll<Result<Bytes, ClientLost>> {
        loop {
            if self.stream().is_turn_over() {
                // Other connections have a turn.
                plain::yield_turn(cx);
                return Poll::Pending;
            }
            let message = self.socket.poll_next_unpin(cx);
            self.spent = None;
            let message = match message {
                Poll::Ready(Some(Ok(Message::Text(text)))) => text.into(),
                Poll::Ready(Some(Ok(Message::Binary(bytes)))) => bytes,
                // Pings and closes are answered by the library, as soon as reading goes on; frames never come out of
                // it.
                Poll::Ready(Some(Ok(control))) => {
                    self.stream().end_control(control.len());
                    continue;
                }
                // The peer has closed, and takes no answers any more.
                Poll::Ready(None) => return Poll::Ready(Err(ClientLost::Gone)),
                Poll::Ready(Some(Err(error))) => {
                    self.close_reason = close_reason(&error);
                    return Poll::Ready(Err(ClientLost::Refused));
                }
                Poll::Pending if self.stream().is_turn_over() => continue,
                Poll::Pending => {
                    let pong_due = self.asked.map(|asked| asked + PONG_TIME);
                    let due = pong_due.into_iter().fold(self.next_ping, Instant::min);
                    ready!(self.timer.poll(Some(due), cx));
                    self.look_for_life()?;
                    continue;
                }
            };
            self.spent = (message.len() > SHORT).then(|| message.clone());
            return Poll::Ready(Ok(message));
        }
    }

    fn look_for_life(&mut self) -> Result<(), ClientLost> {
        let now = Instant::now();
        if let Some(asked) = self.asked {
            if self.stream().life > asked {
                self.asked = None;
            } else if now >= asked + PONG_TIME {
                self.close_reason = (CloseCode::Away, "no sign of life");
                return Err(ClientLost::Gone);
            }
        }
        if now >= self.next_ping {
            self.next_ping = now + PING_INTERVAL;
            self.asked.get_or_insert(now);
            self.ping_is_due = true;
        }
        Ok(())
    }

    /// Whether a message has begun and not ended.
    pub(super) fn is_unfinished(&self) -> bool {
        self.socket.get_ref().is_unfinished()
    }

    /// Refuses the peer, for a message that has begun does not end: it is told `why`.
    pub(super) const fn refuse(&mut self, why: &'static str) {
        self.close_reason = (CloseCode::Policy, why);
    }

    /// Reads from a peer that was refused: nothing that comes is looked at.
    pub(super) fn poll_swallow(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<io::Result<usize>> {
        self.begin_turn();
        plain::poll_read(self.stream(), cx, chunk, CHUNK)
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, which stay the same until it is ready, and gives the number of bytes.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl Iterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        // Waiting pongs would take the room of the message.
        ready!(self.poll_flush(cx))?;
        if self.underway == 0 {
            self.underway = self.put_frames(frames)?;
            ready!(self.poll_flush(cx))?;
        }
        Poll::Ready(Ok(std::mem::take(&mut self.underway)))
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

    /// Puts a message where it is flushed from.
    fn put(&mut self, message: Message) -> io::Result<()> {
        self.socket.start_send_unpin(message).map_err(gone)
    }

    fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.socket
            .poll_flush_unpin(cx)
            .map(|flushed| flushed.map_err(gone))
    }

    pub(super) fn send_due_ping(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.ping_is_due {
            ready!(self.poll_flush(cx))?;
            self.put(Message::Ping(Bytes::new()))?;
            self.ping_is_due = false;
        }
        self.poll_flush(cx)
    }

    pub(super) fn last_taken(&self) -> Option<Instant> {
        Some(self.socket.get_ref().taken)
    }

    /// Closes in order. Of a peer that was refused nothing is looked at any more, not even a close frame: the end of
    /// the stream is enough.
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

/// The reason given where a peer has broken a rule.
fn close_reason(error: &Error) -> (CloseCode, &'static str) {
    match error {
        Error::Capacity(CapacityError::MessageTooLong { .. }) => {
            (CloseCode::Size, "a message has at most 4 MiB")
        }
        Error::Utf8(_) => (CloseCode::Invalid, "a text message is UTF-8"),
        _ => (CloseCode::Protocol, "not as RFC 6455 has it"),
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

/// The part of a frame that one WebSocket frame has room for, and whether a message ends there. A text may be several
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
