//! The stream of a connection that speaks HTTP, with its deadline.
//!
//! **Invariant:** a connection has a deadline at every time: the client has to send its head, or to take its answer.

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

/// How long an answer may take, from its request to the last byte that the client takes.
pub const ANSWER_TIME: Duration = Duration::from_secs(30);
/// How long a client may take from an answer to the head of its next request. A browser that loads the page needs
/// milliseconds, and every connection takes a place.
pub const IDLE_TIME: Duration = Duration::from_secs(2);
/// Bytes that are read at a time.
const CHUNK: usize = 4096;

/// The deadline of a connection: for the next head, or for the end of an answer.
pub(super) struct Deadline {
    due: Cell<Instant>,
    /// Whether an answer is being made or taken.
    is_answering: Cell<bool>,
    /// Whether a request has come.
    pub(super) is_asked: Cell<bool>,
    /// Whether the stream has taken all the bytes that the library has to write.
    pub(super) is_flushed: Cell<bool>,
}

impl Deadline {
    /// The first head has to come until `due`.
    pub(super) const fn new(due: Instant) -> Self {
        Self {
            due: Cell::new(due),
            is_answering: Cell::new(false),
            is_asked: Cell::new(false),
            is_flushed: Cell::new(true),
        }
    }

    /// A request has come.
    pub(super) fn begin_answer(&self) {
        self.is_asked.set(true);
        self.is_answering.set(true);
        self.due.set(Instant::now() + ANSWER_TIME);
    }

    /// The next request is read, which the library does once an answer has been taken.
    fn end_answer(&self) {
        if self.is_answering.take() {
            self.due.set(Instant::now() + IDLE_TIME);
        }
    }

    /// Ends when the deadline has passed. It has to be polled whenever that may have moved.
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
        let room = cursor.remaining();
        if !this.first.is_empty() {
            let length = this.first.len().min(room);
            cursor.put_slice(&this.first.split_to(length));
            return Poll::Ready(Ok(()));
        }
        let mut bytes = [0; CHUNK];
        let bytes = bytes.get_mut(..room.min(CHUNK)).unwrap_or_default();
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
            // Without a request this is the library's own answer to a head that it cannot read. Ours says why.
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
