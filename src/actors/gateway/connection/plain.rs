//! A stream of bytes that carries frames and nothing else.
//!
//! **Invariant:** one poll reads and writes a bounded number of bytes.

use std::io::{self, IoSlice};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use bytes::{BufMut, Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite};

use crate::actors::gateway::limits::{WRITE_BYTES, WRITE_FRAMES};

/// Bytes asked of a stream at a time. It is enough for a burst of short frames, and little enough for the turns of many
/// clients.
pub(super) const CHUNK: usize = 16 * 1024;
/// The same while a long frame comes. Hundreds of clients may send one each, and another client's short frame has to
/// wait for a turn of all of them.
pub(super) const LONG_CHUNK: usize = CHUNK / 2;

/// How long, and how many bytes, of a refused client's input are swallowed so that it can still read why: closing
/// a socket with unread input resets it.
pub(super) const DISCARD_TIME: Duration = Duration::from_secs(1);
pub(super) const DISCARD_BYTES: usize = 16 * 1024 * 1024;

/// Why a client can't be read any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ClientLost {
    /// It is gone.
    Gone,
    /// It has broken a rule, and gets an error at the end.
    #[cfg(feature = "web")]
    Refused,
}

/// Has the task polled again once other tasks and sockets have had a turn. To wake it at once would put it before them.
pub(super) fn yield_turn(cx: &mut Context<'_>) {
    // The wake-up comes though the future is dropped.
    let _ = pin!(tokio::task::yield_now()).poll(cx);
}

/// Appends the available bytes to `chunk`, at most `most` of them; 0 at the end of the stream.
pub(super) fn poll_read<S: AsyncRead + Unpin>(
    stream: &mut S,
    cx: &mut Context<'_>,
    chunk: &mut BytesMut,
    most: usize,
) -> Poll<io::Result<usize>> {
    pin!(read_some(stream, chunk, most)).poll(cx)
}

/// The same for a task of its own.
pub(super) async fn read_some<S: AsyncRead + Unpin>(
    stream: &mut S,
    chunk: &mut BytesMut,
    most: usize,
) -> io::Result<usize> {
    chunk.reserve(most);
    stream.read_buf(&mut chunk.limit(most)).await
}

/// Writes some of `frames`, in order, and gives the number of bytes.
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
