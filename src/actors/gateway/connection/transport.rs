//! The transport of a client's frames: plain bytes, or a WebSocket around them.
//!
//! **Invariant:** the reader gets whole messages, or a byte stream. In a stream, a frame ends at its closing brace or
//! at the end of its line. The writer passes whole frames that end in a newline, for both transports.

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
#[cfg(feature = "web")]
use crate::actors::resources::memory::Permit;
#[cfg(feature = "web")]
use crate::protocol::wire::frame::FrameError;

/// The stream of a served client, and its protocol.
pub(super) enum Transport<S> {
    Plain(S),
    #[cfg(feature = "web")]
    WebSocket(Box<WebSocket<S>>),
}

/// Data from a client.
#[cfg_attr(not(feature = "web"), derive(Clone, Copy))]
pub(super) enum ReceivedData {
    /// This many bytes of a stream. 0 at its end, after which the client may still read.
    Bytes(usize),
    /// A message, and its memory permit if it is long.
    #[cfg(feature = "web")]
    Message(Bytes, Option<Permit>),
    /// A message that is too long, or whose text is not UTF-8. It is the last one.
    #[cfg(feature = "web")]
    Unreadable(FrameError),
}

impl<S: AsyncRead + AsyncWrite + Unpin> Transport<S> {
    /// Whether its frames are messages, which may be binary. The peer then answers the end of the connection.
    pub(super) const fn has_messages(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(_) => true,
        }
    }

    /// Appends the available bytes of a stream, or returns the next message.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<Result<ReceivedData, ClientLost>> {
        Poll::Ready(match self {
            Self::Plain(stream) => match ready!(read_available(stream, cx, chunk)) {
                Ok(bytes) => Ok(ReceivedData::Bytes(bytes)),
                Err(_) => Err(ClientLost::Gone),
            },
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => match ready!(socket.poll_read(cx)) {
                Ok((message, permit)) => Ok(ReceivedData::Message(message, permit)),
                Err(ClientLost::Unreadable(error)) => Ok(ReceivedData::Unreadable(error)),
                Err(lost) => Err(lost),
            },
        })
    }

    /// Whether a message is incomplete. For a stream, the reader checks its frames instead.
    pub(super) fn is_unfinished(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.is_unfinished(),
        }
    }

    /// Whether a long message waits for its memory permit, so nothing is read. For a stream, the reader waits instead.
    pub(super) fn waits_for_room(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.waits_for_room(),
        }
    }

    /// Abandons a frame that takes too long. Returns an error if the transport itself sends `why` to the client.
    pub(super) fn give_up(&mut self, why: &'static str) -> Result<(), ClientLost> {
        match self {
            Self::Plain(_) => {
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

    /// Reads from a refused client. The input is discarded.
    pub(super) fn poll_swallow(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<io::Result<usize>> {
        match self {
            Self::Plain(stream) => read_available(stream, cx, chunk),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => read_available(socket.refused_stream(), cx, chunk),
        }
    }

    /// Sends some of `frames`, in order. Returns the number of bytes. The next call begins with the rest of a frame.
    /// `frames` must stay the same until a call is ready.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        match self {
            Self::Plain(stream) => write_some(stream, cx, frames),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_write(cx, frames),
        }
    }

    /// Sends the transport's own frames, such as answers to pings. Called when there is nothing else to send.
    pub(super) fn poll_flush(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match self {
            Self::Plain(_) => {
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
            Self::Plain(_) => None,
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
            Self::Plain(stream) => {
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
fn read_available<S: AsyncRead + Unpin>(
    stream: &mut S,
    cx: &mut Context<'_>,
    chunk: &mut BytesMut,
) -> Poll<io::Result<usize>> {
    pin!(read_some(stream, chunk)).poll(cx)
}

/// The same as [`read_available`], for a task of its own.
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
