//! Transports carry frames between a client and its connection: as plain bytes, or with another protocol around them.
//!
//! **Invariant:** the reader sees a stream of bytes in which every frame ends where its braces close or with its line.
//! The writer hands over whole frames that end in a newline. Both hold for every transport.

use std::future::Future;
use std::io::{self, IoSlice};
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::timeout;

use crate::actors::gateway::limits::{WRITE_BYTES, WRITE_FRAMES};
use crate::actors::resources::memory::Permit;

/// Bytes asked of a stream at a time: large enough for a burst of small frames, small enough to be fair.
pub(super) const CHUNK: usize = 32 * 1024;

/// How long, and how many bytes, of a refused client's input are swallowed so that it can still read why: closing
/// a socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// The receiving half.
pub(super) trait Inbound {
    /// Appends what is there; 0 at the end of the stream, after which the client may still be reading. Where it
    /// fails, the client is gone.
    fn read(&mut self, chunk: &mut BytesMut) -> impl Future<Output = io::Result<usize>>;

    /// The room that a long message has taken while it came, if this reads messages.
    fn take_permit(&mut self) -> Option<Permit> {
        None
    }

    /// Reads as [`Inbound::read`] does, from a client that was refused: nothing that comes is looked at.
    fn swallow(&mut self, chunk: &mut BytesMut) -> impl Future<Output = io::Result<usize>> {
        self.read(chunk)
    }
}

/// The sending half.
pub(super) trait Outbound {
    /// Whether the other side answers the end: reading goes on until it has.
    const END_IS_ANSWERED: bool;

    /// Sends some of `frames`, in order, and gives the number of bytes; `None` if the client is gone. The rest of a
    /// frame comes first in the next call.
    fn write(&mut self, frames: &[Bytes]) -> impl Future<Output = Option<usize>>;

    /// Sends what the transport itself has to say, if anything; `None` if the client is gone. Called whenever there is
    /// nothing else to send.
    fn send_due_ping(&mut self) -> impl Future<Output = Option<()>>;

    /// Ends the stream in order.
    fn end(&mut self) -> impl Future<Output = io::Result<()>>;
}

/// A stream of bytes that carries frames and nothing else.
pub(super) struct Plain<T>(pub(super) T);

impl<R: AsyncRead + Unpin> Inbound for Plain<R> {
    async fn read(&mut self, chunk: &mut BytesMut) -> io::Result<usize> {
        read_some(&mut self.0, chunk).await
    }
}

impl<W: AsyncWrite + Unpin> Outbound for Plain<W> {
    const END_IS_ANSWERED: bool = false;

    async fn write(&mut self, frames: &[Bytes]) -> Option<usize> {
        if let [frame] = frames {
            let offered = frame.get(..WRITE_BYTES).unwrap_or(frame);
            let written = self.0.write(offered).await;
            return written.ok().filter(|&written| written > 0);
        }
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
        let offered = slices.get(..count).unwrap_or_default();
        let written = self.0.write_vectored(offered).await;
        written.ok().filter(|&written| written > 0)
    }

    async fn send_due_ping(&mut self) -> Option<()> {
        Some(())
    }

    async fn end(&mut self) -> io::Result<()> {
        self.0.shutdown().await
    }
}

/// Reads what is there; 0 at the end of the stream.
pub(super) async fn read_some<R: AsyncRead + Unpin>(
    input: &mut R,
    chunk: &mut BytesMut,
) -> io::Result<usize> {
    chunk.reserve(CHUNK);
    input.read_buf(chunk).await
}

/// Swallows a refused client's input for a bounded time.
pub(super) async fn discard<I: Inbound>(mut input: I) {
    let mut chunk = BytesMut::new();
    let swallow = async {
        let mut swallowed = 0;
        while swallowed < DISCARD_BYTES {
            chunk.clear();
            match input.swallow(&mut chunk).await {
                Ok(0) | Err(_) => break,
                Ok(read) => swallowed += read,
            }
        }
    };
    let _ = timeout(DISCARD_TIME, swallow).await;
}
