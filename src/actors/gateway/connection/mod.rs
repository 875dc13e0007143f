//! One client: bytes in, ops to the registry; messages and responses back, through a bounded outbox.
//!
//! A session judges the client by its first bytes. From then on the actor has two tasks, both with access to its state.
//! The reader hands one op at a time to the registry and waits until it has taken effect. The writer drains the outbox,
//! which the actor's handlers fill. A client that reads slowly fills its own outbox and nothing else.
//!
//! The connection is generic over the stream, so that tests put an in-memory pipe in its place and run in virtual time.
//!
//! **Invariant:** responses and statuses are never dropped; while too many wait, the client is not read.

pub mod admission;
mod computations;
mod flow;
#[cfg(feature = "web")]
mod http;
mod outgoing;
mod plain;
mod reader;
mod session;
mod timer;
mod transport;
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
    /// The stream and the conditions that the client has to meet, until the session takes them.
    newcomer: Option<(S, Arc<Admission>, Ends)>,
    registry: Addr<Registry>,
    /// Where long frames find their room.
    memory: Memory,
    /// The stream, once the client is spoken with.
    transport: Option<Transport<S>>,
    /// Its place among the clients.
    place: Option<HeldPlace>,
    outgoing: Outgoing,
    computations: Computations,
    /// When something was last written or computed, while the reader waited for that.
    room_since: Instant,
    /// Set while a failed call has its reason in `values` too.
    wants_text: Arc<AtomicBool>,
    /// Nothing more is read; queued messages are still sent.
    is_finishing: bool,
    /// Tells the session so.
    finish: Arc<Notify>,
    /// The client speaks another protocol, or has broken a rule. It gets the reason, and its input is discarded.
    is_refused: bool,
    /// The reader has ended.
    is_read_to_its_end: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Starts the actor for `stream` in the present system; nothing is asked of the client first.
    pub fn start_on(stream: S, registry: Addr<Registry>, gauges: Arc<Gauges>) -> Addr<Self> {
        Self::start_with(Arc::default(), Ends::default(), stream, registry, gauges)
    }

    /// Starts the actor for a client that has to be admitted.
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

    /// The same for a client of which `unread` tells how much it has not read.
    pub fn start_reading(
        unread: UnreadSource,
        admission: Arc<Admission>,
        ends: Ends,
        stream: S,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Addr<Self> {
        Self {
            newcomer: Some((stream, admission, ends)),
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

    /// Judges the client, and serves or refuses it.
    fn started(&mut self, ctx: &mut Context<Self>) {
        let Some((stream, admission, ends)) = self.newcomer.take() else {
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
            #[cfg(feature = "web")]
            memory: self.memory.clone(),
            finish: Arc::clone(&self.finish),
            admission,
            ends,
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

// ---- handlers: the writer is polled behind them ---------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<ToClient> for Connection<S> {
    type Result = ();

    /// A panic ends this client and nothing else.
    fn handle(&mut self, message: ToClient, ctx: &mut Context<Self>) {
        if let Err(panic) = contain(|| self.take(message)) {
            tracing::error!(%panic, "a client's actor failed; its connection ends");
            ctx.stop();
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<S> Connection<S> {
    /// Puts what the registry sends into the outbox.
    fn take(&mut self, message: ToClient) {
        let outgoing = &mut self.outgoing;
        match message {
            ToClient::Deliver { topic, frame, done } => {
                outgoing.accept(topic.as_ref(), frame, done);
            }
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

    /// Refuses the client: it gets this status, and nothing that it sends is looked at any more.
    fn refuse(&mut self, status: Bytes) {
        self.is_refused = true;
        self.outgoing.push_response(status, &[]);
    }

    /// Ends reading; queued messages are still sent.
    fn finish(&mut self) {
        self.is_finishing = true;
        self.finish.notify_one();
    }

    /// The client may be read: neither its responses nor its computations pile up.
    fn may_read(&self) -> bool {
        self.may_compute() && !self.computations.are_too_many()
    }

    /// Another computation may start: its response would not come on top of too many.
    const fn may_compute(&self) -> bool {
        self.outgoing.response_bytes() <= MAX_RESPONSES_WAITING
    }

    /// This many bytes are on their way to the client. Whether it may be read now, and could not be before.
    fn note_written(&mut self, bytes: usize) -> bool {
        let may_read = self.may_read();
        self.outgoing.written(bytes);
        if !may_read {
            self.room_since = Instant::now();
        }
        self.start_computation();
        !may_read && self.may_read()
    }

    /// Queues a heavy call behind the connection's others.
    fn enqueue_computation(&mut self, request: Request, length: usize) {
        self.computations.push(request, length);
        self.start_computation();
    }

    /// Starts the next computation if none runs and its response would find room.
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

    /// Gives up the computations: nobody waits for them any more.
    fn abandon_computations(&mut self) {
        self.computations = Computations::default();
    }

    /// Whether nothing more is read or computed.
    fn is_done(&self) -> bool {
        self.is_finishing && !self.is_computing()
    }
}
