//! Writes the messages of one client's outbox. Only the writer writes to the socket of a served client.
//!
//! It is polled after each message that the actor has handled, so the contents of the outbox are offered to the socket
//! in the same turn.
//!
//! **Invariant:** a write that the client does not take blocks only this connection, and only until a deadline. One poll
//! writes a bounded number of bytes.

use std::pin::Pin;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use tokio::time::Instant;

use super::client::Connection;
use super::transport::ClientStream;
use crate::actors::gateway::limits::{LINGER, WRITE_BYTES};
use crate::actors::resources::turns::{Timer, end_turn};

/// The writing half of a connection.
#[derive(Default)]
pub(super) struct ClientWriter {
    timer: Timer,
    /// Deadline of the end of the stream.
    end_due: Option<Instant>,
}

impl<S: ClientStream> ActorFuture<Connection<S>> for ClientWriter {
    type Output = ();

    /// Writes the queued messages, until the connection has finished, its client is gone or has stalled for too long.
    fn poll(
        mut self: Pin<&mut Self>,
        client: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let (mut written, mut now) = (0, Instant::now());
        loop {
            let is_done = client.is_finishing && client.computations.is_empty();
            let has_frames = client.take_frames(now);
            let Some(transport) = &mut client.transport else {
                return client.end_writer(false, ctx);
            };
            let (deadline, release) = if has_frames {
                match transport.poll_write(cx, client.outbox.writing()) {
                    Poll::Ready(Ok(bytes)) => {
                        client.note_written(bytes, now);
                        written += bytes;
                        // After many bytes, other connections have a turn, and the reader may continue.
                        if written >= WRITE_BYTES / 2 {
                            return end_turn(cx);
                        }
                        continue;
                    }
                    Poll::Ready(Err(_)) => return client.end_writer(false, ctx),
                    Poll::Pending => {}
                }
                (client.stall_deadline(), None)
            } else if is_done {
                return self.poll_end(client, ctx, cx);
            } else {
                if matches!(transport.poll_flush(cx), Poll::Ready(Err(_))) {
                    return client.end_writer(false, ctx);
                }
                (client.permit_deadline(), client.next_release())
            };
            ready!(
                self.timer
                    .poll(deadline.into_iter().chain(release).min(), cx)
            );
            now = Instant::now();
            if deadline.is_some_and(|due| due <= now) {
                return client.end_writer(false, ctx);
            }
        }
    }
}

impl ClientWriter {
    /// Ends the stream after the last message.
    fn poll_end<S: ClientStream>(
        &mut self,
        client: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let is_refused = client.is_refused;
        if let Some(transport) = &mut client.transport
            && let Poll::Ready(ended) = transport.poll_end(cx, is_refused)
        {
            return client.end_writer(ended.is_ok(), ctx);
        }
        let due = *self.end_due.get_or_insert_with(|| Instant::now() + LINGER);
        ready!(self.timer.poll(Some(due), cx));
        client.end_writer(false, ctx)
    }
}
