//! The actor of one client: its transport, its computations and its output. The handler of the registry's messages fills
//! the output. The writer drains it, and only the writer writes to the socket of a served client.
//!
//! The writer is polled after each message that the actor has handled, so the contents of the outbox are offered to the
//! socket in the same turn.
//!
//! **Invariant:** a write that the client does not take blocks only this connection, and only until a deadline. The
//! deadline expires only for a client that is finishing, for which responses have waited without a break, or which takes
//! too long for bytes that hold a permit. One poll writes a bounded number of bytes.

use std::collections::VecDeque;
use std::pin::Pin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::transport::{ClientLost, ClientStream, Transport};
use crate::actors::compute::computations::Computations;
use crate::actors::gateway::limits::{MAX_RESPONSES_WAITING, WRITE_BYTES, WRITE_FRAMES};
use crate::actors::gateway::registry::{HeldPlace, Registry, Request, ToClient};
use crate::actors::panics::contain;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::gone::Gone;
use crate::actors::resources::turns::{Timer, end_turn};
use crate::actors::resources::unread::Ends;
use crate::protocol::catalog::Service;
use crate::protocol::limits::{MEDIUM, SHORT};
use crate::protocol::outbox::flow::{FlowControl, UnreadSource};
use crate::protocol::outbox::{Outbox, Room};

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client. Its handler, its reader and its writer have access to it in turn.
pub struct Connection<S> {
    /// The stream, after the session has ended.
    pub(super) transport: Option<Transport<S>>,
    /// The place of a served client. It is free once the actor and its output are gone.
    pub(super) place: Option<HeldPlace>,
    pub(super) ends: Ends,
    pub(super) registry: Addr<Registry>,
    pub(super) gauges: Arc<Gauges>,
    pub(super) outbox: Outbox,
    pub(super) flow: FlowControl,
    /// Whether each write has only one frame. Old clients, which end their frames without a newline, treat the bytes of
    /// one read as one frame.
    pub(super) is_single: bool,
    /// Bytes of short responses that wait to be written, in the mailbox or the outbox. The registry reads it.
    pub(super) backlog: Arc<AtomicUsize>,
    /// Set when the client has left. The nodes read it.
    pub(super) gone: Gone,
    /// Time when the frames being written left the outbox, or when the client last took bytes of them.
    pub(super) progress: Instant,
    /// Start of the time in which responses have waited without a break.
    pub(super) responses_since: Option<Instant>,
    /// Frames that hold a permit of a pool: the deadline of each, and whether any byte of it is left.
    pub(super) permitted: VecDeque<(Instant, Weak<()>)>,
    /// Its heavy calls.
    pub(super) computations: Computations<Request>,
    /// Set when nothing more is read. Queued messages are still sent.
    pub(super) is_finishing: bool,
    /// Set if the client has no place, uses another protocol or violates a rule. It gets the reason, and its input is
    /// discarded.
    pub(super) is_refused: bool,
    /// Set when the reader or the writer has ended.
    pub(super) half_has_ended: bool,
}

impl<S: ClientStream> Connection<S> {
    /// The actor of a client whose session has not ended.
    pub(super) fn new(
        ends: Ends,
        unread: UnreadSource,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Self {
        let now = Instant::now();
        Self {
            transport: None,
            place: None,
            ends,
            registry,
            gauges,
            outbox: Outbox::new(),
            flow: FlowControl::new(unread, now.into_std()),
            is_single: false,
            backlog: Arc::default(),
            gone: Gone::of(ends),
            progress: now,
            responses_since: None,
            permitted: VecDeque::new(),
            computations: Computations::default(),
            is_finishing: false,
            is_refused: false,
            half_has_ended: false,
        }
    }

    /// The transport of a client that is served.
    pub(super) fn transport(&mut self) -> Result<&mut Transport<S>, ClientLost> {
        self.transport.as_mut().ok_or(ClientLost::Gone)
    }

    // ---- into the outbox --------------------------------------------------------------------------------------------

    /// Puts a message of the registry into the outbox.
    fn accept(&mut self, message: ToClient) {
        match message {
            ToClient::Deliver { topic, frame, at } => {
                let frame = self.limit_time(frame, MEDIUM);
                self.counting_dropped(|outbox| match &topic {
                    Some(topic) => outbox.push(topic, frame, at.into_std()),
                    None => outbox.push_feedback(frame, at.into_std()),
                });
            }
            ToClient::Respond { frame, service } => {
                self.push_response(frame, service.map_or(&[], Service::supersedes));
                if service.is_some_and(Service::is_computation) {
                    self.computations.end();
                    self.start_computation();
                }
            }
            ToClient::Configure { topic, throttle } => self.outbox.configure(&topic, throttle),
            ToClient::Discard { topic } => self.outbox.discard_held(&[&*topic]),
            ToClient::Finish => self.is_finishing = true,
        }
    }

    fn counting_dropped(&mut self, act: impl FnOnce(&mut Outbox)) {
        let before = self.outbox.dropped();
        act(&mut self.outbox);
        self.gauges.add_dropped(self.outbox.dropped() - before);
    }

    /// Adds a response or a status. Discards held-back messages on `superseded` topics, because they are older.
    pub(super) fn push_response(&mut self, frame: Bytes, superseded: &[&'static str]) {
        self.responses_since.get_or_insert_with(Instant::now);
        let frame = self.limit_time(frame, SHORT);
        self.outbox.push_response(frame, superseded);
    }

    // ---- out of the outbox ------------------------------------------------------------------------------------------

    /// Takes the next frames out of the outbox, if all previous ones were written. Returns whether there are frames to
    /// write. Nothing is held back from a client whose connection is finishing.
    fn take_frames(&mut self, now: Instant) -> bool {
        if self.outbox.is_writing() {
            return true;
        }
        let (has_topics, holds_back) = (self.outbox.has_topics(), self.outbox.holds_back());
        if self.outbox.is_empty() && !holds_back {
            return false;
        }
        // Only topic messages need room.
        let room = if self.is_finishing || !(has_topics || holds_back) {
            Room::Unlimited
        } else {
            self.flow.room(now.into_std())
        };
        let most = if self.is_single { 1 } else { WRITE_FRAMES };
        let fresh = self.flow.max_age();
        self.counting_dropped(|outbox| {
            outbox.allow(room, fresh);
            outbox.take_frames(now.into_std(), most, WRITE_BYTES);
        });
        self.progress = now;
        self.outbox.is_writing()
    }

    /// Notes that `bytes` of the frames were written.
    fn note_written(&mut self, bytes: usize, now: Instant) {
        self.progress = now;
        self.flow.note_written(bytes, now.into_std());
        let (responses, short) = (self.outbox.response_bytes(), self.outbox.short_bytes());
        self.outbox.note_written(bytes);
        if self.outbox.response_bytes() == responses {
            return;
        }
        let written = short - self.outbox.short_bytes();
        self.backlog.fetch_sub(written, Ordering::Relaxed);
        if self.outbox.response_bytes() == 0 {
            self.responses_since = None;
        }
        self.start_computation();
    }

    /// Whether the reader may go on: neither too many responses nor too many computations wait, or it is to end.
    pub(super) fn may_read(&self) -> bool {
        self.is_finishing || (self.may_compute() && !self.computations.is_full())
    }

    /// Whether another computation may start: not too many responses wait.
    pub(super) const fn may_compute(&self) -> bool {
        self.outbox.response_bytes() <= MAX_RESPONSES_WAITING
    }
}

// ---- the actor ------------------------------------------------------------------------------------------------------

impl<S: ClientStream> Actor for Connection<S> {
    type Context = Context<Self>;
}

impl<S: ClientStream> Handler<ToClient> for Connection<S> {
    type Result = ();

    fn handle(&mut self, message: ToClient, ctx: &mut Context<Self>) {
        if let Err(panic) = contain(|| self.accept(message)) {
            Self::fail("actor", &panic, ctx);
        }
        if self.is_finishing && self.transport.is_none() {
            // The session has not ended, so nothing waits to be sent.
            ctx.stop();
        }
    }
}

// ---- the writer -----------------------------------------------------------------------------------------------------

/// The writing half of a connection.
#[derive(Default)]
pub(super) struct ClientWriter {
    pub(super) timer: Timer,
    /// Deadline of the end of the stream.
    pub(super) end_due: Option<Instant>,
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
