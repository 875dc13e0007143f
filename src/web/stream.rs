//! The stream of an HTTP connection, with its deadline.
//!
//! **Invariant:** a connection always has a deadline: for the client's next head, or for reading the answer.

use std::cell::Cell;
use std::future::poll_fn;
use std::io;
use std::pin::{Pin, pin};
use std::rc::Rc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use bytes::Bytes;
use hyper::rt::ReadBufCursor;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, sleep_until};

use super::report::MAX_FILE;

/// Longest time of an answer, from its request until the client has read the last byte: 20 s, and a second for each MiB
/// of a longest file. Other clients may wait for its permit.
pub const ANSWER_TIME: Duration = Duration::from_secs(20 + MAX_FILE / (1024 * 1024));
/// Longest time from an answer to the head of the next request. A browser that loads the page needs milliseconds,
/// and every connection uses a place.
pub const IDLE_TIME: Duration = Duration::from_secs(2);
/// Bytes that are read at a time.
const CHUNK: usize = 4096;

/// The deadline of a connection: for the next head, or for the end of an answer.
pub(super) struct Deadline {
    due: Cell<Instant>,
    /// Whether an answer is being prepared or sent.
    is_answering: Cell<bool>,
    /// Whether a request has arrived.
    pub(super) is_asked: Cell<bool>,
    /// Whether the stream has written all bytes of the library.
    pub(super) is_flushed: Cell<bool>,
}

impl Deadline {
    /// A deadline with the first head at `due`.
    pub(super) const fn new(due: Instant) -> Self {
        Self {
            due: Cell::new(due),
            is_answering: Cell::new(false),
            is_asked: Cell::new(false),
            is_flushed: Cell::new(true),
        }
    }

    /// A request has arrived.
    pub(super) fn begin_answer(&self) {
        self.is_asked.set(true);
        self.is_answering.set(true);
        self.due.set(Instant::now() + ANSWER_TIME);
    }

    /// The next request is read. The library does this after an answer has been sent.
    fn end_answer(&self) {
        if self.is_answering.take() {
            self.due.set(Instant::now() + IDLE_TIME);
        }
    }

    /// Ends when the deadline has passed. It must be polled whenever the deadline may have changed.
    pub(super) async fn pass(&self) {
        let mut sleep = pin!(sleep_until(Instant::now()));
        poll_fn(|cx| {
            if sleep.deadline() != self.due.get() {
                sleep.as_mut().reset(self.due.get());
            }
            sleep.as_mut().poll(cx)
        })
        .await;
    }
}

/// A stream whose first bytes have been read already.
pub(super) struct HttpStream<S> {
    pub(super) stream: S,
    pub(super) first: Bytes,
    pub(super) deadline: Rc<Deadline>,
}

impl<S: AsyncRead + Unpin> hyper::rt::Read for HttpStream<S> {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        mut cursor: ReadBufCursor<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        this.deadline.end_answer();
        let left = cursor.remaining();
        if !this.first.is_empty() {
            let length = this.first.len().min(left);
            cursor.put_slice(&this.first.split_to(length));
            return Poll::Ready(Ok(()));
        }
        let mut bytes = [0; CHUNK];
        let bytes = bytes.get_mut(..left.min(CHUNK)).unwrap_or_default();
        let mut buffer = ReadBuf::new(bytes);
        ready!(Pin::new(&mut this.stream).poll_read(cx, &mut buffer))?;
        cursor.put_slice(buffer.filled());
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> hyper::rt::Write for HttpStream<S> {
    fn poll_write(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        if !this.deadline.is_asked.get() {
            // Without a request this is the library's answer to a head that it cannot read. It is discarded,
            // because the answer here has the reason.
            return Poll::Ready(Ok(bytes.len()));
        }
        this.deadline.is_flushed.set(false);
        Pin::new(&mut this.stream).poll_write(cx, bytes)
    }

    fn poll_flush(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        let polled = Pin::new(&mut this.stream).poll_flush(cx);
        this.deadline.is_flushed.set(polled.is_ready());
        polled
    }

    fn poll_shutdown(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(cx)
    }
}
