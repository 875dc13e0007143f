//! WebSocket clients: a message is a frame. Pings and closes of the peer are answered. TCP keepalive detects a peer
//! whose machine is gone, as for every other client.
//!
//! **Invariant:** at most one write and one pong wait to be written.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use bytes::{Buf, Bytes, BytesMut};
use tokio::io::AsyncWrite;
use tokio::time::Instant;

use crate::actors::gateway::ends::ClientLost;
use crate::actors::gateway::limits::FRAMES_IN_A_ROW;
use crate::protocol::wire::frame::FramePart;
use crate::protocol::wire::websocket::{MessageReader, SocketEnd, append_frame, opcode};

/// Bytes of payload in one WebSocket frame and in one write. A longer message is sent in fragments, so that the
/// client's progress is measurable.
const FRAGMENT: usize = 32 * 1024;

/// Codes of close frames.
const GOING_AWAY: u16 = 1001;
const PROTOCOL_ERROR: u16 = 1002;
const POLICY_VIOLATION: u16 = 1008;

/// A stream after the handshake.
pub(super) struct WebSocket<S> {
    pub(super) stream: S,
    /// The incoming messages.
    pub(super) messages: MessageReader,
    /// Frames that are being written.
    output: BytesMut,
    /// The kind of the message that the next write continues, if there is one.
    unfinished: Option<u8>,
    /// Bytes of the writer's frames in `output`.
    unflushed: usize,
    /// Time when the peer last took a byte.
    taken: Instant,
    /// The close reason for the peer.
    close_reason: (Option<u16>, &'static str),
    /// The peer has closed, and accepts only a close frame.
    is_closed: bool,
    /// The close frame has been queued.
    is_closing: bool,
}

impl<S: AsyncWrite + Unpin> WebSocket<S> {
    /// Takes a stream after the handshake.
    pub(super) fn new(stream: S) -> Self {
        Self {
            stream,
            messages: MessageReader::default(),
            output: BytesMut::new(),
            unfinished: None,
            unflushed: 0,
            taken: Instant::now(),
            close_reason: (Some(GOING_AWAY), "shutting down"),
            is_closed: false,
            is_closing: false,
        }
    }

    // ---- receiving --------------------------------------------------------------------------------------------------

    /// The next message. Returns an error if none can follow.
    pub(super) fn cut(&mut self) -> Result<Option<FramePart>, ClientLost> {
        match self.messages.cut() {
            Some(part) => Ok(Some(part)),
            None => self.check_end().map(|()| None),
        }
    }

    /// Reads pings and closes behind messages that wait.
    pub(super) fn look_ahead(&mut self, chunk: &mut BytesMut) -> Result<(), ClientLost> {
        self.messages.push(chunk);
        chunk.clear();
        self.messages.look_ahead(FRAMES_IN_A_ROW);
        self.check_end()
    }

    fn check_end(&mut self) -> Result<(), ClientLost> {
        match self.messages.end() {
            None => Ok(()),
            Some(SocketEnd::Closed(code)) => {
                self.close_reason = (code, "");
                self.is_closed = true;
                Err(ClientLost::Gone)
            }
            Some(SocketEnd::Violated) => Err(self.violated()),
        }
    }

    /// Refuses the peer, which has violated the protocol.
    pub(super) const fn violated(&mut self) -> ClientLost {
        self.close_reason = (Some(PROTOCOL_ERROR), "violates RFC 6455");
        ClientLost::Refused
    }

    /// Refuses the peer because of an incomplete message. The close frame has the reason `why`.
    pub(super) const fn refuse(&mut self, why: &'static str) {
        self.close_reason = (Some(POLICY_VIOLATION), why);
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, which must stay the same until a call is ready. Returns the number of bytes.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl Iterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        if self.is_closed {
            ready!(self.poll_end(cx, false))?;
            return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into()));
        }
        ready!(self.poll_flush(cx))?;
        if self.unflushed == 0 {
            self.unflushed = self.put_frames(frames);
            ready!(self.poll_flush(cx))?;
        }
        Poll::Ready(Ok(std::mem::take(&mut self.unflushed)))
    }

    fn put_frames<'a>(&mut self, frames: impl Iterator<Item = &'a Bytes>) -> usize {
        let mut written = 0;
        for frame in frames {
            let mut rest = frame.as_ref();
            while !rest.is_empty() {
                let room = FRAGMENT.saturating_sub(written);
                let kind = self.unfinished.unwrap_or_else(|| kind_of(rest));
                let (piece, is_last) = first_piece(rest, kind == opcode::TEXT, room);
                if written > 0 && !is_last {
                    return written;
                }
                written += piece.len();
                rest.advance(piece.len());
                let opcode = match self.unfinished {
                    Some(_) => opcode::CONTINUATION,
                    None => kind,
                };
                self.unfinished = (!is_last).then_some(kind);
                let is_line = is_last && kind == opcode::TEXT;
                let line = piece.strip_suffix(b"\n").filter(|_| is_line);
                append_frame(&mut self.output, opcode, is_last, line.unwrap_or(piece));
                if !is_last {
                    return written;
                }
            }
        }
        written
    }

    /// Sends queued frames, and the answer to the latest ping.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        loop {
            if self.output.is_empty() {
                match self.messages.take_ping().filter(|_| !self.is_closing) {
                    Some(ping) => append_frame(&mut self.output, opcode::PONG, true, &ping),
                    None => return Poll::Ready(Ok(())),
                }
            }
            let stream = Pin::new(&mut self.stream);
            match ready!(stream.poll_write(cx, &self.output))? {
                0 => return Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                taken => self.output.advance(taken),
            }
            self.taken = Instant::now();
        }
    }

    pub(super) const fn last_taken(&self) -> Option<Instant> {
        Some(self.taken)
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
            let code = code.map(u16::to_be_bytes);
            let mut payload = code.into_iter().flatten().collect::<Vec<u8>>();
            payload.extend_from_slice(why.as_bytes());
            append_frame(&mut self.output, opcode::CLOSE, true, &payload);
            self.is_closing = true;
            ready!(self.poll_flush(cx))?;
        }
        if is_refused {
            return Pin::new(&mut self.stream).poll_shutdown(cx);
        }
        Poll::Ready(Ok(()))
    }
}

/// The kind of a frame: JSON begins with a brace, CBOR never does.
fn kind_of(frame: &[u8]) -> u8 {
    if frame.first() == Some(&b'{') {
        opcode::TEXT
    } else {
        opcode::BINARY
    }
}

/// The part of a frame that fits into one WebSocket frame, and whether a message ends there. A text may be several
/// messages, one per line.
fn first_piece(frame: &[u8], is_text: bool, room: usize) -> (&[u8], bool) {
    let offered = frame.get(..room).unwrap_or(frame);
    if !is_text {
        return (offered, offered.len() == frame.len());
    }
    let end = offered.iter().position(|&byte| byte == b'\n');
    let line = end.and_then(|end| offered.get(..=end));
    (line.unwrap_or(offered), line.is_some())
}
