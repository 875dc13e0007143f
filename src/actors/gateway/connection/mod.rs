//! One client: its bytes become ops for the registry. Messages and responses return through a bounded outbox.
//!
//! A session detects the protocol from the first bytes. Then the actor has two tasks, which share its state. The
//! reader sends one op at a time to the registry and waits until it has taken effect. The writer drains the outbox,
//! which the actor's handlers fill. A client that reads slowly fills only its own outbox.
//!
//! The connection is generic over the stream, so that tests can use an in-memory pipe and run in virtual time.
//!
//! **Invariant:** responses and statuses are never dropped. While too many wait, the client is not read.

pub mod admission;
mod computations;
mod flow;
#[cfg(feature = "web")]
mod http;
mod outgoing;
mod reader;
mod session;
mod timer;
mod transport;
mod turns;
#[cfg(feature = "web")]
mod websocket;
mod writer;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actix::prelude::*;
use bytes::Bytes;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::Notify;
use tokio::time::Instant;

use self::admission::Admission;
use self::computations::Computations;
pub use self::flow::UnreadSource;
use self::outgoing::Outgoing;
use self::session::{ClientSession, HeldPlace};
use self::transport::Transport;
pub use super::ends::Ends;
use super::limits::MAX_RESPONSES_WAITING;
use super::messages::{Outlets, Request, ToClient};
use super::registry::Registry;
use crate::actors::panics::{contain, contained};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::Memory;
use crate::protocol::catalog::Service;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client.
pub struct Connection<S> {
    /// The stream and the conditions of admission, until the session takes them.
    newcomer: Option<(S, Arc<Admission>)>,
    ends: Ends,
    registry: Addr<Registry>,
    /// The shared memory for long frames.
    memory: Memory,
    /// The stream, after the session has ended.
    transport: Option<Transport<S>>,
    /// Its place among the clients.
    place: Option<HeldPlace>,
    outgoing: Outgoing,
    computations: Computations,
    /// Time of the last write or finished computation while the reader waited for one.
    room_since: Instant,
    /// Set while the reason of a failed call is sent in `values` too.
    wants_text: Arc<AtomicBool>,
    /// Set when nothing more is read. Queued messages are still sent.
    is_finishing: bool,
    /// Notifies the session of that.
    finish: Arc<Notify>,
    /// Set if the client uses another protocol or violates a rule. It gets the reason, and its input is discarded.
    is_refused: bool,
    /// Set when the reader has ended.
    is_read_to_its_end: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Starts the actor for `stream` in the current system. It requires no token.
    pub fn start_on(stream: S, registry: Addr<Registry>, gauges: Arc<Gauges>) -> Addr<Self> {
        Self::start_with(Arc::default(), Ends::default(), stream, registry, gauges)
    }

    /// Starts the actor for a client that must be admitted.
    pub fn start_with(
        admission: Arc<Admission>,
        ends: impl Into<Ends>,
        stream: S,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Addr<Self> {
        let ends = ends.into();
        let unread = flow::between(ends);
        Self::start_reading(unread, admission, ends, stream, registry, gauges)
    }

    /// Starts the actor for a client whose unread bytes `unread` returns.
    pub fn start_reading(
        unread: UnreadSource,
        admission: Arc<Admission>,
        ends: Ends,
        stream: S,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Addr<Self> {
        Self {
            newcomer: Some((stream, admission)),
            ends,
            registry,
            memory: gauges.memory().clone(),
            transport: None,
            place: None,
            outgoing: Outgoing::new(gauges, unread),
            computations: Computations::default(),
            room_since: Instant::now(),
            wants_text: Arc::default(),
            is_finishing: false,
            finish: Arc::default(),
            is_refused: false,
            is_read_to_its_end: false,
        }
        .start()
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Actor for Connection<S> {
    type Context = Context<Self>;

    /// Runs the session, which serves or refuses the client.
    fn started(&mut self, ctx: &mut Context<Self>) {
        let Some((stream, admission)) = self.newcomer.take() else {
            return;
        };
        let outlets = Outlets {
            mailbox: ctx.address().recipient(),
            wants_text: Arc::clone(&self.wants_text),
            gone: Arc::new(AtomicBool::new(false)),
            backlog: self.outgoing.backlog(),
        };
        let session = ClientSession {
            registry: self.registry.clone(),
            finish: Arc::clone(&self.finish),
            admission,
            ends: self.ends,
        };
        let opened = contained(session.run(stream, outlets)).into_actor(self);
        ctx.spawn(opened.map(|opened, connection, ctx| match opened {
            Ok(Some(opened)) => connection.converse(opened, ctx),
            Ok(None) => ctx.stop(),
            Err(panic) => {
                tracing::error!(%panic, "a client's session failed; its connection ends");
                ctx.stop();
            }
        }));
    }
}

// ---- handlers: the writer is polled after them ----------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<ToClient> for Connection<S> {
    type Result = ();

    /// A panic ends only this connection.
    fn handle(&mut self, message: ToClient, ctx: &mut Context<Self>) {
        if let Err(panic) = contain(|| self.take(message)) {
            tracing::error!(%panic, "a client's actor failed; its connection ends");
            ctx.stop();
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<S> Connection<S> {
    /// Puts a message of the registry into the outbox.
    fn take(&mut self, message: ToClient) {
        let outgoing = &mut self.outgoing;
        match message {
            ToClient::Deliver { topic, frame } => outgoing.accept(topic.as_ref(), frame),
            ToClient::Respond { frame, service } => {
                outgoing.push_response(frame, service.map_or(&[], Service::supersedes));
                if service.is_some_and(Service::is_computation) {
                    self.computations.end();
                    self.room_since = Instant::now();
                    self.start_computation();
                }
            }
            ToClient::Configure { topic, throttle } => outgoing.configure(&topic, throttle),
            ToClient::Finish => self.finish(),
        }
    }

    /// Refuses the client: it gets this status, and its further input is discarded.
    fn refuse(&mut self, status: Bytes) {
        self.is_refused = true;
        self.outgoing.push_response(status, &[]);
    }

    /// Ends reading. Queued messages are still sent.
    fn finish(&mut self) {
        self.is_finishing = true;
        self.finish.notify_one();
    }

    /// Whether the client may be read: neither too many responses nor too many computations wait.
    fn may_read(&self) -> bool {
        self.may_compute() && !self.computations.are_too_many()
    }

    /// Whether another computation may start: not too many responses wait.
    const fn may_compute(&self) -> bool {
        self.outgoing.response_bytes() <= MAX_RESPONSES_WAITING
    }

    /// Notes that `bytes` were written. Returns whether that allows the client to be read again.
    fn note_written(&mut self, bytes: usize) -> bool {
        let may_read = self.may_read();
        self.outgoing.written(bytes);
        if !may_read {
            self.room_since = Instant::now();
        }
        self.start_computation();
        !may_read && self.may_read()
    }

    /// Queues a heavy call.
    fn enqueue_computation(&mut self, request: Request, length: usize) {
        self.computations.push(request, length);
        self.start_computation();
    }

    /// Starts the next computation if none runs and not too many responses wait.
    fn start_computation(&mut self) {
        if self.computations.can_start()
            && self.may_compute()
            && let Some(request) = self.computations.start()
        {
            self.registry.do_send(request);
        }
    }

    /// Whether a computation runs or waits.
    fn is_computing(&self) -> bool {
        !self.computations.is_empty()
    }

    /// Drops the computations: the client no longer waits for them.
    fn abandon_computations(&mut self) {
        self.computations = Computations::default();
    }

    /// Whether nothing more is read or computed.
    fn is_done(&self) -> bool {
        self.is_finishing && !self.is_computing()
    }
}
