//! The writer of one client drains the outbox, several frames at a time. Only the writer writes to the socket of a
//! served client.
//!
//! The writer is polled after each message that the actor has handled, so the contents of the outbox are offered to the
//! socket in the same turn.
//!
//! **Invariant:** a write that the client does not take blocks only this connection, and only until a timeout. One poll
//! writes a bounded number of bytes.

use std::pin::Pin;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::Connection;
use super::timer::Timer;
use super::transport::Transport;
use super::turns::Turns;
use crate::actors::gateway::limits::{LINGER, WRITE_BYTES};
use crate::actors::panics::contain;

/// The writing half of a connection. It ends the connection.
#[derive(Default)]
pub(super) struct ClientWriter {
    timer: Timer,
    turns: Turns,
    /// Deadline of the end of the stream.
    end_due: Option<Instant>,
    /// All messages were written. The reader may continue.
    is_all_written: bool,
    /// Deadline of the reader, if the peer answers the end.
    answer_due: Option<Instant>,
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> ActorFuture<Connection<S>> for ClientWriter {
    type Output = ();

    fn poll(
        self: Pin<&mut Self>,
        connection: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let this = self.get_mut();
        match contain(|| this.poll_to_the_end(connection, cx)) {
            Ok(Poll::Pending) => return Poll::Pending,
            Ok(Poll::Ready(())) => {}
            Err(panic) => tracing::error!(%panic, "a client's writer failed; its connection ends"),
        }
        ctx.stop();
        Poll::Ready(())
    }
}

impl ClientWriter {
    /// Writes until the connection has finished, its client is gone, or its client has stalled for too long.
    fn poll_to_the_end<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        if !self.is_all_written {
            let is_all_written = ready!(self.poll_write(connection, cx));
            let transport = connection.transport.as_ref();
            let is_answered = transport.is_some_and(Transport::has_messages);
            if !is_all_written || !(connection.is_refused || is_answered) {
                return Poll::Ready(());
            }
            self.is_all_written = true;
            if !connection.is_refused {
                self.answer_due = Some(Instant::now() + LINGER);
            }
        }
        if connection.is_read_to_its_end {
            return Poll::Ready(());
        }
        self.timer.poll(self.answer_due, cx)
    }

    /// Writes the queued messages. Ready at the end of the connection, with whether all of them were written.
    fn poll_write<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<bool> {
        let mut written = 0;
        loop {
            let (is_finishing, is_done) = (connection.is_finishing, connection.is_done());
            let Some(transport) = &mut connection.transport else {
                return Poll::Ready(false);
            };
            let (patience, release) = if connection.outgoing.take(is_finishing) {
                match transport.poll_write(cx, connection.outgoing.frames()) {
                    Poll::Ready(Ok(bytes)) => {
                        // After many bytes, other connections have a turn. The reader may continue.
                        let may_read = connection.note_written(bytes);
                        written += bytes;
                        if written >= WRITE_BYTES / 2 {
                            self.turns.end(cx);
                            return Poll::Pending;
                        }
                        if may_read {
                            cx.waker().wake_by_ref();
                        }
                        continue;
                    }
                    Poll::Ready(Err(_)) => return Poll::Ready(false),
                    Poll::Pending => {}
                }
                let taken = transport.last_taken();
                (connection.outgoing.patience(taken, is_finishing), None)
            } else if is_done {
                return self.poll_end(connection, cx);
            } else {
                let is_gone = matches!(transport.poll_flush(cx), Poll::Ready(Err(_)));
                if is_gone || connection.outgoing.is_stuck() {
                    return Poll::Ready(false);
                }
                self.turns.rest();
                (None, connection.outgoing.next_release())
            };
            ready!(self.timer.poll(patience.or(release), cx));
            if patience.is_some() {
                return Poll::Ready(false);
            }
        }
    }

    fn poll_end<S: AsyncRead + AsyncWrite + Unpin + 'static>(
        &mut self,
        connection: &mut Connection<S>,
        cx: &mut task::Context<'_>,
    ) -> Poll<bool> {
        let is_refused = connection.is_refused;
        if let Some(transport) = &mut connection.transport
            && let Poll::Ready(ended) = transport.poll_end(cx, is_refused)
        {
            return Poll::Ready(ended.is_ok());
        }
        let due = *self.end_due.get_or_insert_with(|| Instant::now() + LINGER);
        self.timer.poll(Some(due), cx).map(|()| false)
    }
}
