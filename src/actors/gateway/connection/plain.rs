//! A byte stream that carries only frames.
//!
//! **Invariant:** one poll reads and writes a bounded number of bytes.

use std::io::{self, IoSlice};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use bytes::{BufMut, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};

use crate::actors::gateway::limits::{WRITE_BYTES, WRITE_FRAMES};

/// Most bytes of one read. It is enough for a burst of short frames.
pub(super) const CHUNK: usize = 32 * 1024;

/// Time and bytes for which a refused client's input is discarded, so that it can read the reason. Closing a socket
/// with unread input resets it.
pub(super) const DISCARD_TIME: Duration = Duration::from_secs(1);
pub(super) const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// Why a client can no longer be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ClientLost {
    /// It has disconnected.
    Gone,
    /// It has violated a rule, and gets an error at the end.
    #[cfg(feature = "web")]
    Refused,
}

/// Appends at most [`CHUNK`] available bytes to `chunk`. Returns 0 at the end of the stream.
pub(super) fn poll_read<S: AsyncRead + Unpin>(
    stream: &mut S,
    cx: &mut Context<'_>,
    chunk: &mut BytesMut,
) -> Poll<io::Result<usize>> {
    pin!(read_some(stream, chunk)).poll(cx)
}

/// The same as [`poll_read`], for a task of its own.
pub(super) async fn read_some<S: AsyncRead + Unpin>(
    stream: &mut S,
    chunk: &mut BytesMut,
) -> io::Result<usize> {
    chunk.reserve(CHUNK);
    stream.read_buf(&mut chunk.limit(CHUNK)).await
}

/// Writes some of `frames`, in order. Returns the number of bytes.
pub(super) fn poll_write<'a, S: AsyncWrite + Unpin>(
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
