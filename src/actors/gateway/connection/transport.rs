//! The transport of a client's frames: plain bytes, or a WebSocket around them. Pings and closes of a WebSocket are
//! answered. TCP keepalive detects a peer whose machine is gone, for both.
//!
//! **Invariant:** the reader gets frames, and the writer passes whole frames that end in a newline, for both
//! transports. At most one write and one pong of a WebSocket wait to be written.

use std::io::{self, IoSlice};
use std::iter::once;
use std::ops::Deref;
use std::pin::{Pin, pin};
use std::task::{Context, Poll, ready};

use bytes::{Buf, BufMut, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};

use crate::actors::gateway::limits::{FRAMES_IN_A_ROW, READ_BYTES, WRITE_BYTES, WRITE_FRAMES};
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::frame::{FrameError, FramePart, FrameReader};
use crate::protocol::wire::websocket::{MessageReader, SocketEnd, append_frame, opcode};

/// Bytes of payload in one WebSocket frame and in one write. A longer message is sent in fragments, so that the
/// client's progress is measurable.
const FRAGMENT: usize = 32 * 1024;

/// Codes of close frames.
const GOING_AWAY: u16 = 1001;
const PROTOCOL_ERROR: u16 = 1002;
const POLICY_VIOLATION: u16 = 1008;

/// Why a client can no longer be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ClientLost {
    /// It has disconnected.
    Gone,
    /// It has violated a rule, and gets an error at the end.
    Refused,
}

/// The stream of a client.
pub trait ClientStream: AsyncRead + AsyncWrite + Unpin + 'static {}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> ClientStream for S {}

/// The stream of a served client, and its protocol.
pub(super) struct Transport<S> {
    stream: S,
    protocol: Protocol,
}

enum Protocol {
    Plain(FrameReader),
    WebSocket(Box<WebSocket>, Web),
}

/// Only an HTTP request opens a WebSocket. In a program without HTTP this has no value, so the compiler omits the code of
/// the protocol.
#[cfg(feature = "web")]
struct Web;
#[cfg(not(feature = "web"))]
enum Web {}

impl<S: ClientStream> Transport<S> {
    /// A stream of lines.
    pub(super) const fn plain(stream: S) -> Self {
        let protocol = Protocol::Plain(FrameReader::new());
        Self { stream, protocol }
    }

    /// A stream after the handshake of a WebSocket.
    #[cfg(feature = "web")]
    pub(super) fn socket(stream: S) -> Self {
        let protocol = Protocol::WebSocket(Box::new(WebSocket::new()), Web);
        Self { stream, protocol }
    }

    /// Whether its frames are messages, which may be binary. The peer then answers the end of the connection.
    pub(super) const fn is_socket(&self) -> bool {
        matches!(self.protocol, Protocol::WebSocket(..))
    }

    // ---- receiving --------------------------------------------------------------------------------------------------

    /// Appends at most [`READ_BYTES`] available bytes to `chunk`. Returns 0 at the end of the stream, after which the
    /// client may still read. A WebSocket must not end without a close frame.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<Result<usize, ClientLost>> {
        let read = ready!(pin!(read_some(&mut self.stream, chunk)).poll(cx));
        Poll::Ready(match (read, &mut self.protocol) {
            (Err(_), _) => Err(ClientLost::Gone),
            (Ok(0), Protocol::WebSocket(socket, _)) => Err(socket.violated()),
            (Ok(bytes), _) => Ok(bytes),
        })
    }

    /// Adds received bytes. Cut off all frames before the next push, so that memory stays bounded.
    pub(super) fn push(&mut self, chunk: &[u8]) {
        match &mut self.protocol {
            Protocol::Plain(frames) => frames.push(chunk),
            Protocol::WebSocket(socket, _) => socket.messages.push(chunk),
        }
    }

    /// Cuts off the next frame, if it is complete. Returns an error if none can follow.
    pub(super) fn cut(&mut self) -> Result<Option<FramePart>, ClientLost> {
        match &mut self.protocol {
            Protocol::Plain(frames) => Ok(frames.cut()),
            Protocol::WebSocket(socket, _) => match socket.messages.cut() {
                Some(part) => Ok(Some(part)),
                None => socket.check_end().map(|()| None),
            },
        }
    }

    /// Reads pings and a close in `chunk`, which follow messages that wait. Returns an error if the client has ended.
    /// Lines stay in `chunk`.
    pub(super) fn look_ahead(&mut self, chunk: &mut BytesMut) -> Result<(), ClientLost> {
        let Protocol::WebSocket(socket, _) = &mut self.protocol else {
            return Ok(());
        };
        socket.messages.push(chunk);
        chunk.clear();
        socket.messages.look_ahead(FRAMES_IN_A_ROW);
        socket.check_end()
    }

    /// Bytes that [`look_ahead`](Self::look_ahead) has taken.
    pub(super) fn taken_ahead(&self) -> usize {
        match &self.protocol {
            Protocol::Plain(_) => 0,
            Protocol::WebSocket(socket, _) => socket.messages.waiting(),
        }
    }

    /// Whether a frame is incomplete.
    pub(super) fn is_unfinished(&self) -> bool {
        match &self.protocol {
            Protocol::Plain(frames) => frames.is_unfinished(),
            Protocol::WebSocket(socket, _) => socket.messages.is_unfinished(),
        }
    }

    /// Whether a frame is incomplete, and so long that it needs a memory permit.
    pub(super) fn is_long_coming(&self) -> bool {
        let buffered = match &self.protocol {
            Protocol::Plain(frames) => frames.buffered(),
            Protocol::WebSocket(socket, _) => socket.messages.buffered(),
        };
        buffered > MEDIUM && self.is_unfinished()
    }

    /// Ends the stream. An incomplete frame is an error.
    pub(super) fn finish(&mut self) -> Option<FrameError> {
        match &mut self.protocol {
            Protocol::Plain(frames) => frames.finish(),
            Protocol::WebSocket(..) => None,
        }
    }

    /// Abandons a frame that takes too long. Returns an error if the transport itself sends `why` to the client.
    pub(super) fn give_up(&mut self, why: &'static str) -> Result<(), ClientLost> {
        match &mut self.protocol {
            Protocol::Plain(_) => Ok(()),
            Protocol::WebSocket(socket, _) => Err(socket.refuse(POLICY_VIOLATION, why)),
        }
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, in order. Returns the number of bytes. The next call begins with the rest of a frame. Over
    /// WebSocket the number is 0 while a part of them is still to be sent. `frames` must stay the same until then.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl Iterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        let stream = &mut self.stream;
        match &mut self.protocol {
            Protocol::Plain(_) => write_some(stream, cx, frames),
            Protocol::WebSocket(socket, _) => socket.poll_write(stream, cx, frames),
        }
    }

    /// Sends the transport's own frames, such as answers to pings. Called when there is nothing else to send.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.protocol {
            Protocol::Plain(_) => Poll::Ready(Ok(())),
            Protocol::WebSocket(socket, _) => socket.poll_flush(&mut self.stream, cx),
        }
    }

    /// Closes the stream in an orderly way. The input of a refused peer is discarded, including its close frame. The end
    /// of the stream is enough for it.
    pub(super) fn poll_end(
        &mut self,
        cx: &mut Context<'_>,
        is_refused: bool,
    ) -> Poll<io::Result<()>> {
        if let Protocol::WebSocket(socket, _) = &mut self.protocol {
            ready!(socket.poll_close(&mut self.stream, cx))?;
            if !is_refused {
                return Poll::Ready(Ok(()));
            }
        }
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

// ---- a plain stream -------------------------------------------------------------------------------------------------

/// Appends at most [`READ_BYTES`] available bytes to `chunk`. Returns 0 at the end of the stream.
pub(super) async fn read_some<S: AsyncRead + Unpin>(
    stream: &mut S,
    chunk: &mut BytesMut,
) -> io::Result<usize> {
    chunk.reserve(READ_BYTES);
    stream.read_buf(&mut chunk.limit(READ_BYTES)).await
}

/// Writes some of `frames`, in order. Returns the number of bytes.
fn write_some<'a, S: AsyncWrite + Unpin, B: Deref<Target = [u8]> + 'a>(
    stream: &mut S,
    cx: &mut Context<'_>,
    frames: impl Iterator<Item = &'a B>,
) -> Poll<io::Result<usize>> {
    let mut slices = [IoSlice::new(&[]); WRITE_FRAMES];
    let mut room = WRITE_BYTES;
    let mut count = 0;
    for (slice, frame) in slices.iter_mut().zip(frames) {
        let offered = frame.len().min(room);
        *slice = IoSlice::new(frame.get(..offered).unwrap_or_default());
        count += 1;
        room -= offered;
        if room == 0 {
            break;
        }
    }
    let stream = Pin::new(stream);
    let written = match slices.get(..count).unwrap_or_default() {
        [slice] => ready!(stream.poll_write(cx, slice))?,
        slices => ready!(stream.poll_write_vectored(cx, slices))?,
    };
    Poll::Ready(match written {
        0 => Err(io::ErrorKind::WriteZero.into()),
        written => Ok(written),
    })
}

// ---- a WebSocket: a message is a frame ------------------------------------------------------------------------------

/// The state of a WebSocket.
struct WebSocket {
    /// The incoming messages.
    messages: MessageReader,
    /// Frames that are being written.
    output: BytesMut,
    /// The kind of the message that the next write continues, if there is one.
    unfinished: Option<u8>,
    /// Bytes of the writer's frames in `output`.
    unflushed: usize,
    /// The close reason for the peer.
    close_reason: (Option<u16>, &'static str),
    /// The peer has closed, and accepts only a close frame.
    is_closed: bool,
    /// The close frame has been queued.
    is_closing: bool,
}

impl WebSocket {
    fn new() -> Self {
        Self {
            messages: MessageReader::default(),
            output: BytesMut::new(),
            unfinished: None,
            unflushed: 0,
            close_reason: (Some(GOING_AWAY), "shutting down"),
            is_closed: false,
            is_closing: false,
        }
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
    const fn violated(&mut self) -> ClientLost {
        self.refuse(PROTOCOL_ERROR, "violates RFC 6455")
    }

    /// Refuses the peer. The close frame has the code and the reason.
    const fn refuse(&mut self, code: u16, why: &'static str) -> ClientLost {
        self.close_reason = (Some(code), why);
        ClientLost::Refused
    }

    fn poll_write<'a, S: AsyncWrite + Unpin>(
        &mut self,
        stream: &mut S,
        cx: &mut Context<'_>,
        frames: impl Iterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        if self.is_closed {
            ready!(self.poll_close(stream, cx))?;
            return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into()));
        }
        if self.unflushed == 0 {
            ready!(self.poll_flush(stream, cx))?;
            self.unflushed = self.put_frames(frames);
        }
        ready!(self.poll_output(stream, cx))?;
        if !self.output.is_empty() {
            return Poll::Ready(Ok(0));
        }
        Poll::Ready(Ok(std::mem::take(&mut self.unflushed)))
    }

    /// Sends a part of the queued frames.
    fn poll_output<S: AsyncWrite + Unpin>(
        &mut self,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        let sent = ready!(write_some(stream, cx, once(&self.output)))?;
        self.output.advance(sent);
        Poll::Ready(Ok(()))
    }

    fn put_frames<'a>(&mut self, frames: impl Iterator<Item = &'a Bytes>) -> usize {
        let mut written = 0;
        for frame in frames {
            let mut rest = frame.as_ref();
            while !rest.is_empty() {
                let room = FRAGMENT.saturating_sub(written);
                let kind = self.unfinished.unwrap_or_else(|| kind_of(rest));
                let (piece, taken, is_last) = first_piece(rest, kind == opcode::TEXT, room);
                if written > 0 && !is_last {
                    return written;
                }
                written += taken;
                rest.advance(taken);
                let opcode = match self.unfinished {
                    Some(_) => opcode::CONTINUATION,
                    None => kind,
                };
                self.unfinished = (!is_last).then_some(kind);
                append_frame(&mut self.output, opcode, is_last, piece);
                if !is_last {
                    return written;
                }
            }
        }
        written
    }

    /// Sends queued frames, and the answer to the latest ping.
    fn poll_flush<S: AsyncWrite + Unpin>(
        &mut self,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        loop {
            if self.output.is_empty() {
                match self.messages.take_ping().filter(|_| !self.is_closing) {
                    Some(ping) => append_frame(&mut self.output, opcode::PONG, true, &ping),
                    None => return Poll::Ready(Ok(())),
                }
            }
            ready!(self.poll_output(stream, cx))?;
        }
    }

    /// Sends the close frame.
    fn poll_close<S: AsyncWrite + Unpin>(
        &mut self,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        ready!(self.poll_flush(stream, cx))?;
        if self.is_closing {
            return Poll::Ready(Ok(()));
        }
        let (code, why) = self.close_reason;
        let code = code.map(u16::to_be_bytes);
        let mut payload = code.into_iter().flatten().collect::<Vec<u8>>();
        payload.extend_from_slice(why.as_bytes());
        append_frame(&mut self.output, opcode::CLOSE, true, &payload);
        self.is_closing = true;
        self.poll_flush(stream, cx)
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

/// The part of a frame that fits into one WebSocket frame, the bytes that it takes from the frame, and whether a message
/// ends there. A text may be several messages, one per line. The end of a line is not sent.
fn first_piece(frame: &[u8], is_text: bool, room: usize) -> (&[u8], usize, bool) {
    let offered = frame.get(..room).unwrap_or(frame);
    let end = || offered.iter().position(|&byte| byte == b'\n');
    let line = is_text
        .then(end)
        .flatten()
        .and_then(|end| offered.get(..end));
    line.map_or(
        (offered, offered.len(), offered.len() == frame.len()),
        |line| (line, line.len() + 1, true),
    )
}
