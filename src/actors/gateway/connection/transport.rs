//! The transport of a client's frames: plain bytes, or a WebSocket around them.
//!
//! **Invariant:** the reader gets a stream of bytes, in which every frame ends where its braces close or with its line,
//! or whole messages. The writer hands over whole frames that end in a newline, for either.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::plain::{self, CHUNK, ClientLost};
#[cfg(feature = "web")]
use super::websocket::WebSocket;
#[cfg(feature = "web")]
use crate::actors::resources::memory::Permit;

/// The stream of a client that is served, and the protocol on it.
pub(super) enum Transport<S> {
    Plain(S),
    #[cfg(feature = "web")]
    WebSocket(Box<WebSocket<S>>),
}

/// What a client has sent.
#[cfg_attr(not(feature = "web"), derive(Clone, Copy))]
pub(super) enum ReceivedData {
    /// This many bytes of a stream; none at its end, after which the client may still be reading.
    Bytes(usize),
    /// A message, and the room that it takes if it is long.
    #[cfg(feature = "web")]
    Message(Bytes, Option<Permit>),
}

impl<S: AsyncRead + AsyncWrite + Unpin> Transport<S> {
    /// Whether its frames are messages, which may be binary. Its end is answered by the other side.
    pub(super) const fn has_messages(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(_) => true,
        }
    }

    /// Appends the available bytes of a stream, or gives the next message.
    pub(super) fn poll_read(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
        most: usize,
    ) -> Poll<Result<ReceivedData, ClientLost>> {
        Poll::Ready(match self {
            Self::Plain(stream) => match ready!(plain::poll_read(stream, cx, chunk, most)) {
                Ok(bytes) => Ok(ReceivedData::Bytes(bytes)),
                Err(_) => Err(ClientLost::Gone),
            },
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => ready!(socket.poll_read(cx))
                .map(|(message, permit)| ReceivedData::Message(message, permit)),
        })
    }

    /// Whether a message has begun and not ended. The frames of a stream are the reader's.
    pub(super) fn is_unfinished(&self) -> bool {
        match self {
            Self::Plain(_) => false,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.is_unfinished(),
        }
    }

    /// Gives up a frame that takes too long. It is an error where the transport itself tells the client `why`.
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

    /// Reads from a client that was refused: nothing that comes is looked at.
    pub(super) fn poll_swallow(
        &mut self,
        cx: &mut Context<'_>,
        chunk: &mut BytesMut,
    ) -> Poll<io::Result<usize>> {
        match self {
            Self::Plain(stream) => plain::poll_read(stream, cx, chunk, CHUNK),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_swallow(cx, chunk),
        }
    }

    /// Sends some of `frames`, in order, and gives the number of bytes. The rest of a frame comes first in the next
    /// call; until one is ready, `frames` stay the same.
    pub(super) fn poll_write<'a>(
        &mut self,
        cx: &mut Context<'_>,
        frames: impl ExactSizeIterator<Item = &'a Bytes>,
    ) -> Poll<io::Result<usize>> {
        match self {
            Self::Plain(stream) => plain::poll_write(stream, cx, frames),
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.poll_write(cx, frames),
        }
    }

    /// Sends what the transport itself has to say: the answers to pings. Called when there is nothing else to send.
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

    /// When the client last took a byte of a write that goes on. Over TCP a write is over then.
    pub(super) fn last_taken(&self) -> Option<Instant> {
        match self {
            Self::Plain(_) => None,
            #[cfg(feature = "web")]
            Self::WebSocket(socket) => socket.last_taken(),
        }
    }

    /// Ends the stream in order.
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
