//! The actor of one client: its transport, its computations and its output with its deadlines. The handler of the
//! registry's messages fills the output, and the writer drains it.
//!
//! **Invariant:** a deadline of the output expires only for a client that is finishing, for which responses have waited
//! without a break, or which takes too long for bytes that hold a permit.

use std::collections::VecDeque;
use std::mem::replace;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};
use std::task::{self, Poll, ready};

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use tokio::time::Instant;

use super::transport::{ClientLost, ClientStream, Protocol, Transport};
use crate::actors::compute::computations::Computations;
use crate::actors::gateway::limits::{
    DISCARD_BYTES, LINGER, MAX_RESPONSES_WAITING, STALL_LIMIT, WRITE_BYTES, WRITE_FRAMES,
};
use crate::actors::gateway::registry::{HeldPlace, Registry, Request, ToClient};
use crate::actors::panics::{Contained, contain};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::gone::Gone;
use crate::actors::resources::memory::time_to_read;
use crate::actors::resources::turns::end_turn;
use crate::actors::resources::unread::Ends;
use crate::protocol::catalog::Service;
use crate::protocol::limits::{MEDIUM, SHORT};
use crate::protocol::messages::{self, Level};
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
            outbox: Outbox::default(),
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

    /// Whether the client is served over WebSocket. Then its frames are messages, which may be binary, and it answers
    /// the close frame.
    pub(super) fn is_socket(&self) -> bool {
        let protocol = self.transport.as_ref().map(|transport| &transport.protocol);
        matches!(protocol, Some(Protocol::WebSocket(..)))
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
    pub(super) fn take_frames(&mut self, now: Instant) -> bool {
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
    pub(super) fn note_written(&mut self, bytes: usize, now: Instant) {
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

    /// Starts the next computation if none runs and not too many responses wait.
    pub(super) fn start_computation(&mut self) {
        if self.may_compute()
            && let Some(request) = self.computations.start()
        {
            self.registry.do_send(request);
        }
    }

    // ---- deadlines of the output ------------------------------------------------------------------------------------

    /// The deadline of a client that does not take a write. `None` if no response and no bytes with a permit wait,
    /// unless it is finishing.
    pub(super) fn stall_deadline(&mut self) -> Option<Instant> {
        let stalled = match self.responses_since {
            Some(since) => Some(since.max(self.progress) + STALL_LIMIT),
            None => self.is_finishing.then(|| self.progress + LINGER),
        };
        stalled.into_iter().chain(self.permit_deadline()).min()
    }

    /// The earliest deadline of the waiting bytes that hold a permit.
    pub(super) fn permit_deadline(&mut self) -> Option<Instant> {
        self.permitted.retain(|(_, left)| left.strong_count() > 0);
        self.permitted.iter().map(|(due, _)| *due).min()
    }

    /// Notes the deadline of a frame that holds a permit, because it has more than `most` bytes.
    fn limit_time(&mut self, frame: Bytes, most: usize) -> Bytes {
        if frame.len() <= most {
            return frame;
        }
        self.permit_deadline();
        let left = Arc::new(());
        let due = Instant::now() + time_to_read(frame.len());
        self.permitted.push_back((due, Arc::downgrade(&left)));
        Bytes::from_owner(Limited(frame, left))
    }

    /// The earliest time of the next write, if nothing can be written now. Either a message is throttled, or the client
    /// must read first.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let release = self.outbox.next_release();
        let waits = self.outbox.has_topics() && !self.outbox.has_responses();
        let query = self.flow.next_query().filter(|_| waits);
        let first = release.into_iter().chain(query).min();
        first.map(Instant::from_std)
    }

    // ---- the end ----------------------------------------------------------------------------------------------------

    /// Refuses the client: it gets a status with the reason, and its further input is discarded.
    pub(super) fn refuse(&mut self, why: &str) {
        self.refuse_with(messages::status(Level::Error, why, None));
    }

    /// The same, for a reason that is already a status.
    pub(super) fn refuse_with(&mut self, status: Bytes) {
        self.is_refused = true;
        self.backlog.fetch_add(status.len(), Ordering::Relaxed);
        self.push_response(status, &[]);
    }

    /// The client is not served any more. Its output remains to be written, but it no longer waits for computations.
    pub(super) fn leave(&mut self) {
        self.computations = Computations::default();
        self.gone.set();
        self.is_finishing = true;
    }

    /// Reads and discards the input of a client, up to a limit, if it is refused. `bytes` were discarded before.
    pub(super) fn poll_discard(
        &mut self,
        bytes: &mut usize,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let Some(transport) = self.transport.as_mut().filter(|_| self.is_refused) else {
            return Poll::Ready(());
        };
        let read = ready!(transport.poll_read(cx, &mut BytesMut::new()));
        *bytes += read.unwrap_or(0);
        if read.unwrap_or(0) == 0 || *bytes >= DISCARD_BYTES {
            return Poll::Ready(());
        }
        end_turn(cx)
    }

    /// Ends the connection if the reader and the writer have ended.
    pub(super) fn end_half(&mut self, ctx: &mut Context<Self>) -> Poll<()> {
        if replace(&mut self.half_has_ended, true) {
            ctx.stop();
        }
        Poll::Ready(())
    }

    /// Ends the writer. The client has time to read the last messages if it is refused, or must send a close frame.
    pub(super) fn end_writer(&mut self, is_all_written: bool, ctx: &mut Context<Self>) -> Poll<()> {
        if is_all_written && (self.is_refused || self.is_socket()) {
            ctx.run_later(LINGER, |_, ctx| ctx.stop());
            return self.end_half(ctx);
        }
        ctx.stop();
        Poll::Ready(())
    }

    /// Ends the connection after a panic in `part` of it.
    pub(super) fn fail(part: &str, panic: &Contained, ctx: &mut Context<Self>) {
        tracing::error!(%panic, "a client's {part} failed; its connection ends");
        ctx.stop();
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

/// A frame whose client has a deadline, until its last byte is written or dropped.
struct Limited(
    Bytes,
    #[expect(dead_code, reason = "it is dropped with the frame")] Arc<()>,
);

impl AsRef<[u8]> for Limited {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}
