//! The transport of a client's frames: plain bytes, or a WebSocket around them, with its pings and its close. TCP keepalive detects
//! a peer whose machine is gone, for both.
//!
//! **Invariant:** the reader gets frames, and the writer passes whole frames that end in a newline, for both
//! transports.

use std::io::{self, IoSlice};
use std::iter::once;
use std::ops::Deref;
use std::pin::{Pin, pin};
use std::task::{Context, Poll, ready};

use bytes::{BufMut, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};

use crate::actors::gateway::limits::{FRAMES_IN_A_ROW, READ_BYTES, WRITE_BYTES, WRITE_FRAMES};
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::frame::{FrameError, FramePart, FrameReader};
use crate::protocol::wire::websocket::{SocketEnd, WebSocket};

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
    pub(super) stream: S,
    pub(super) protocol: Protocol,
}

pub(super) enum Protocol {
    Plain(FrameReader),
    WebSocket(Box<WebSocket>, Web),
}

/// Only an HTTP request opens a WebSocket. In a program without HTTP this has no value, so the compiler omits the code of
/// the protocol.
#[cfg(feature = "web")]
pub(super) struct Web;
#[cfg(not(feature = "web"))]
pub(super) enum Web {}

impl<S: ClientStream> Transport<S> {
    /// A stream of lines.
    pub(super) const fn plain(stream: S) -> Self {
        let protocol = Protocol::Plain(FrameReader::new());
        Self { stream, protocol }
    }

    /// A stream after the handshake of a WebSocket.
    #[cfg(feature = "web")]
    pub(super) fn socket(stream: S) -> Self {
        let protocol = Protocol::WebSocket(Box::default(), Web);
        Self { stream, protocol }
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
            (Ok(0), Protocol::WebSocket(socket, _)) => {
                socket.outgoing.answer(SocketEnd::Violated);
                Err(ClientLost::Refused)
            }
            (Ok(bytes), _) => Ok(bytes),
        })
    }

    /// Adds received bytes. Cut off all frames before the next push, so that memory stays bounded.
    pub(super) fn push(&mut self, chunk: &[u8]) {
        match &mut self.protocol {
            Protocol::Plain(frames) => frames.push(chunk),
            Protocol::WebSocket(socket, _) => socket.incoming.push(chunk),
        }
    }

    /// Cuts off the next frame, if it is complete. Returns an error if none can follow.
    pub(super) fn cut(&mut self) -> Result<Option<FramePart>, ClientLost> {
        match &mut self.protocol {
            Protocol::Plain(frames) => Ok(frames.cut()),
            Protocol::WebSocket(socket, _) => match socket.incoming.cut() {
                Some(part) => Ok(Some(part)),
                None => Self::check_end(socket).map(|()| None),
            },
        }
    }

    /// Whether a frame is incomplete.
    pub(super) fn is_unfinished(&self) -> bool {
        match &self.protocol {
            Protocol::Plain(frames) => frames.is_unfinished(),
            Protocol::WebSocket(socket, _) => socket.incoming.is_unfinished(),
        }
    }

    /// Whether a frame is incomplete, and so long that it needs a memory permit.
    pub(super) fn is_long_coming(&self) -> bool {
        let buffered = match &self.protocol {
            Protocol::Plain(frames) => frames.buffered(),
            Protocol::WebSocket(socket, _) => socket.incoming.buffered(),
        };
        buffered > MEDIUM && self.is_unfinished()
    }

    /// Whether each frame needs a separate write.
    pub(super) const fn is_single(&self) -> bool {
        match &self.protocol {
            Protocol::Plain(frames) => frames.is_single(),
            Protocol::WebSocket(..) => false,
        }
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, in order. Returns the number of bytes. The next call begins with the rest of a frame. Over
    /// WebSocket the number is 0 while a part of them is still to be sent. `frames` must stay the same until then.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        let stream = &mut self.stream;
        match &mut self.protocol {
            Protocol::Plain(_) => write_some(stream, cx, frames),
            Protocol::WebSocket(socket, _) => Self::poll_messages(socket, stream, cx, frames),
        }
    }

    /// Sends the transport's own frames, such as answers to pings. Called when there is nothing else to send.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.protocol {
            Protocol::Plain(_) => Poll::Ready(Ok(())),
            Protocol::WebSocket(socket, _) => Self::poll_output(socket, &mut self.stream, cx),
        }
    }

    // ---- a WebSocket: its messages, the answers to pings, its close; and the end of a stream ------------------------

    /// An error if the peer has ended the stream.
    fn check_end(socket: &mut WebSocket) -> Result<(), ClientLost> {
        match socket.end() {
            None => Ok(()),
            Some(SocketEnd::Closed(_)) => Err(ClientLost::Gone),
            Some(SocketEnd::Violated) => Err(ClientLost::Refused),
        }
    }

    /// Reads pings and a close in `chunk`, which follow messages that wait. Returns an error if the client has ended.
    /// Lines stay in `chunk`.
    pub(super) fn look_ahead(&mut self, chunk: &mut BytesMut) -> Result<(), ClientLost> {
        let Protocol::WebSocket(socket, _) = &mut self.protocol else {
            return Ok(());
        };
        socket.incoming.push(chunk);
        chunk.clear();
        socket.incoming.look_ahead(FRAMES_IN_A_ROW);
        Self::check_end(socket)
    }

    /// Bytes that [`look_ahead`](Self::look_ahead) has taken.
    pub(super) fn taken_ahead(&self) -> usize {
        match &self.protocol {
            Protocol::Plain(_) => 0,
            Protocol::WebSocket(socket, _) => socket.incoming.waiting(),
        }
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
            Protocol::WebSocket(socket, _) => {
                socket.outgoing.refuse(why);
                Err(ClientLost::Refused)
            }
        }
    }

    /// Sends a part of `frames`. Returns their number of bytes, once that part is sent. A peer that has closed gets
    /// only a close frame.
    fn poll_messages<'a>(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        if let Some(SocketEnd::Closed(_)) = socket.incoming.end() {
            ready!(Self::poll_close(socket, stream, cx))?;
            return Poll::Ready(Err(io::ErrorKind::ConnectionAborted.into()));
        }
        if !socket.outgoing.has_messages() {
            ready!(Self::poll_output(socket, stream, cx))?;
            socket.outgoing.put(frames);
        }
        let sent = ready!(write_some(stream, cx, once(socket.outgoing.output())))?;
        Poll::Ready(Ok(socket.outgoing.sent(sent)))
    }

    /// Sends the output, and the answer to the latest ping.
    fn poll_output(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        while let Some(output) = socket.output() {
            let sent = ready!(write_some(stream, cx, once(output)))?;
            socket.outgoing.sent(sent);
        }
        Poll::Ready(Ok(()))
    }

    /// Sends the close frame.
    fn poll_close(
        socket: &mut WebSocket,
        stream: &mut S,
        cx: &mut Context<'_>,
    ) -> Poll<io::Result<()>> {
        ready!(Self::poll_output(socket, stream, cx))?;
        socket.outgoing.put_close();
        Self::poll_output(socket, stream, cx)
    }

    /// Closes the stream in an orderly way, after a close frame over WebSocket. The input of a refused peer is
    /// discarded, including its close frame. The end of the stream is enough for it.
    pub(super) fn poll_end(
        &mut self,
        cx: &mut Context<'_>,
        is_refused: bool,
    ) -> Poll<io::Result<()>> {
        if let Protocol::WebSocket(socket, _) = &mut self.protocol {
            ready!(Self::poll_close(socket, &mut self.stream, cx))?;
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
pub(super) fn write_some<'a, S: AsyncWrite + Unpin, B: Deref<Target = [u8]> + 'a>(
    stream: &mut S,
    cx: &mut Context<'_>,
    mut frames: impl ExactSizeIterator<Item = &'a B>,
) -> Poll<io::Result<usize>> {
    let stream = Pin::new(stream);
    let written = if frames.len() == 1 {
        let frame = frames.next().map_or(&[][..], |frame| frame);
        let offered = frame.get(..WRITE_BYTES).unwrap_or(frame);
        ready!(stream.poll_write(cx, offered))?
    } else {
        let mut slices = [IoSlice::new(&[]); WRITE_FRAMES];
        let mut left = WRITE_BYTES;
        let mut count = 0;
        for (slice, frame) in slices.iter_mut().zip(frames) {
            let offered = frame.len().min(left);
            *slice = IoSlice::new(frame.get(..offered).unwrap_or_default());
            count += 1;
            left -= offered;
            if left == 0 {
                break;
            }
        }
        let slices = slices.get(..count).unwrap_or_default();
        ready!(stream.poll_write_vectored(cx, slices))?
    };
    Poll::Ready(match written {
        0 => Err(io::ErrorKind::WriteZero.into()),
        written => Ok(written),
    })
}
