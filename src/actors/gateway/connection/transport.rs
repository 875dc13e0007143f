//! The transport of a client's frames: plain bytes, or a WebSocket around them.
//!
//! **Invariant:** the reader gets frames, and the writer passes whole frames that end in a newline, for both
//! transports.

use std::io::{self, IoSlice};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, ready};

use bytes::{BufMut, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};
use tokio::time::Instant;

#[cfg(feature = "web")]
use super::websocket::WebSocket;
use crate::actors::gateway::ends::ClientLost;
use crate::actors::gateway::limits::{READ_BYTES, WRITE_BYTES, WRITE_FRAMES};
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::frame::{FrameError, FramePart, FrameReader};

/// The stream of a served client, and its protocol.
pub(super) enum Transport<S> {
    Plain(S, FrameReader),
    #[cfg(feature = "web")]
    WebSocket(Box<WebSocket<S>>),
}

impl<S: AsyncRead + AsyncWrite + Unpin> Transport<S> {
    /// Whether its frames are messages, which may be binary. The peer then answers the end of the connection.
    pub(super) const fn has_messages(&self) -> bool {
        match self {
            Self::Plain(..) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(_) => true,
        }
    }

    // ---- receiving --------------------------------------------------------------------------------------------------

    /// Appends at most [`READ_BYTES`] available bytes to `chunk`. Returns 0 at the end of the stream, after which the
    /// client may still read. A WebSocket must not end without a close frame.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<Result<usize, ClientLost>> {
        let stream = match self {
            Self::Plain(stream, _) => stream,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => &mut socket.stream,
        };
        let read = ready!(pin!(read_some(stream, chunk)).poll(cx));
        Poll::Ready(match (read, self) {
            (Err(_), _) => Err(ClientLost::Gone),
            #[cfg(feature = "web")]
            (Ok(0), Self::WebSocket(socket)) => Err(socket.violated()),
            (Ok(bytes), _) => Ok(bytes),
        })
    }

    /// Adds received bytes. Cut off all frames before the next push, so that memory stays bounded.
    pub(super) fn push(&mut self, chunk: &[u8]) {
        match self {
            Self::Plain(_, frames) => frames.push(chunk),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.messages.push(chunk),
        }
    }

    /// Cuts off the next frame, if it is complete. Returns an error if none can follow.
    pub(super) fn cut(&mut self) -> Result<Option<FramePart>, ClientLost> {
        match self {
            Self::Plain(_, frames) => Ok(frames.cut()),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.cut(),
        }
    }

    /// Looks for the end of the client in `chunk`, which follows frames that wait. Returns an error if it has ended.
    pub(super) fn look_ahead(&mut self, chunk: &mut BytesMut) -> Result<(), ClientLost> {
        match self {
            Self::Plain(..) => {
                let _ = chunk;
                Ok(())
            }
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.look_ahead(chunk),
        }
    }

    /// Bytes that [`look_ahead`](Self::look_ahead) has taken.
    pub(super) fn taken_ahead(&self) -> usize {
        match self {
            Self::Plain(..) => 0,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.messages.waiting(),
        }
    }

    /// Whether a frame is incomplete.
    pub(super) fn is_unfinished(&self) -> bool {
        match self {
            Self::Plain(_, frames) => frames.is_unfinished(),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.messages.is_unfinished(),
        }
    }

    /// Whether a frame is incomplete, and so long that it needs a memory permit.
    pub(super) fn is_long_coming(&self) -> bool {
        let buffered = match self {
            Self::Plain(_, frames) => frames.buffered(),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.messages.buffered(),
        };
        buffered > MEDIUM && self.is_unfinished()
    }

    /// Ends the stream. An incomplete frame is an error.
    pub(super) fn finish(&mut self) -> Option<FrameError> {
        match self {
            Self::Plain(_, frames) => frames.finish(),
            #[cfg(feature = "web")]
            Self::WebSocket(_) => None,
        }
    }

    /// Abandons a frame that takes too long. Returns an error if the transport itself sends `why` to the client.
    pub(super) fn give_up(&mut self, why: &'static str) -> Result<(), ClientLost> {
        match self {
            Self::Plain(..) => {
                let _ = why;
                Ok(())
            }
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => {
                socket.refuse(why);
                Err(ClientLost::Refused)
            }
        }
    }

    // ---- sending ----------------------------------------------------------------------------------------------------

    /// Sends some of `frames`, in order. Returns the number of bytes. The next call begins with the rest of a frame.
    /// `frames` must stay the same until a call is ready.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        match self {
            Self::Plain(stream, _) => write_some(stream, cx, frames),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_write(cx, frames),
        }
    }

    /// Sends the transport's own frames, such as answers to pings. Called when there is nothing else to send.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match self {
            Self::Plain(..) => {
                let _ = cx;
                Poll::Ready(Ok(()))
            }
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_flush(cx),
        }
    }

    /// Time when the client last took a byte of the current write. `None` over TCP, where every write is short.
    pub(super) fn last_taken(&self) -> Option<Instant> {
        match self {
            Self::Plain(..) => None,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.last_taken(),
        }
    }

    /// Closes the stream in an orderly way.
    pub(super) fn poll_end(
        &mut self,
        cx: &mut Context<'_>,
        is_refused: bool,
    ) -> Poll<io::Result<()>> {
        match self {
            Self::Plain(stream, _) => {
                let _ = is_refused;
                Pin::new(stream).poll_shutdown(cx)
            }
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_end(cx, is_refused),
        }
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
fn write_some<'a, S: AsyncWrite + Unpin>(
    stream: &mut S,
    cx: &mut Context<'_>,
    frames: impl ExactSizeIterator<Item = &'a Bytes>,
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
