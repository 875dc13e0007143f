//! One client: bytes in, ops to the registry; messages and responses back, through a bounded outbox.
//!
//! A session judges the client by its first bytes. From then on three parts on one thread share one `Shared`. The
//! reading task hands one op at a time to the registry and waits until it has taken effect. The actor's handlers put
//! messages into the outbox. The writer, which the same actor polls behind its handlers, drains it. A client that
//! reads slowly fills its own outbox and nothing else.
//!
//! The connection is generic over the stream, so that tests put an in-memory pipe in its place and run in virtual time.
//!
//! **Invariant:** responses and statuses are never dropped; while too many wait, the client is not read.

pub mod admission;
mod computations;
mod conversation;
mod outgoing;
mod session;
mod shared;
mod transport;
mod unfinished;
mod unread;
#[cfg(feature = "web")]
mod websocket;

use std::future::poll_fn;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actix::prelude::*;
use tokio::io::{AsyncRead, AsyncWrite};

use self::admission::Admission;
use self::session::ClientSession;
use self::shared::Shared;
pub use self::unread::UnreadSource;
pub use super::ends::Ends;
use super::messages::{Configure, Deliver, Disconnect, Finish, Outlets, Response};
use super::registry::Registry;
use crate::actors::panics::{contain, contained};
use crate::actors::resources::gauges::Gauges;
use crate::protocol::catalog::Service;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client.
pub struct Connection<S> {
    /// The stream, until the session takes it.
    stream: Option<S>,
    shared: Rc<Shared>,
    /// The conditions that the client has to meet first.
    admission: Arc<Admission>,
    ends: Ends,
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
        let unread = unread::between(ends);
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
            stream: Some(stream),
            shared: Rc::new(Shared::new(registry, gauges, unread)),
            admission,
            ends,
        }
        .start()
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Actor for Connection<S> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        let address = ctx.address();
        let outlets = Outlets {
            deliver: address.clone().recipient(),
            respond: address.clone().recipient(),
            configure: address.clone().recipient(),
            finish: address.recipient(),
            wants_text: Arc::clone(&self.shared.wants_text),
            gone: Arc::new(AtomicBool::new(false)),
            backlog: self.shared.outgoing.backlog(),
        };
        self.begin(outlets, ctx);
    }

    fn stopped(&mut self, _: &mut Context<Self>) {
        if let Some(id) = self.shared.id.take() {
            self.shared.registry.do_send(Disconnect(id));
        }
    }
}

// ---- handlers: the writer is polled behind them ---------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Deliver> for Connection<S> {
    type Result = ();

    fn handle(&mut self, message: Deliver, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| connection.shared.outgoing.accept(message));
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Response> for Connection<S> {
    type Result = ();

    fn handle(&mut self, response: Response, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| {
            let shared = &connection.shared;
            let service = response.service;
            let superseded = service.map_or(&[][..], Service::supersedes);
            shared.outgoing.push_response(response.frame, superseded);
            if service.is_some_and(Service::is_computation) {
                shared.end_computation();
            }
        });
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Configure> for Connection<S> {
    type Result = ();

    fn handle(&mut self, configure: Configure, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| {
            let outgoing = &connection.shared.outgoing;
            outgoing.configure(&configure.topic, configure.throttle);
        });
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Finish> for Connection<S> {
    type Result = ();

    fn handle(&mut self, _: Finish, _: &mut Context<Self>) {
        self.shared.finish();
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Serves the client, or says why not, behind the handlers of this actor, and ends with it.
    fn begin(&mut self, outlets: Outlets, ctx: &mut Context<Self>) {
        let Some(stream) = self.stream.take() else {
            return;
        };
        let session = ClientSession {
            shared: Rc::clone(&self.shared),
            finish: ctx.address().recipient(),
            admission: Arc::clone(&self.admission),
            ends: self.ends,
        };
        let outgoing = Rc::clone(&self.shared.outgoing);
        let mut session = Box::pin(contained(session.run(stream, outlets)));
        let served = poll_fn(move |cx| {
            let polled = session.as_mut().poll(cx);
            outgoing.write(cx);
            polled
        });
        ctx.spawn(served.into_actor(self).map(|served, _, ctx| {
            if let Err(panic) = served {
                tracing::error!(%panic, "a client's task failed; its connection ends");
            }
            ctx.stop();
        }));
    }

    /// Does `work`; its panic ends this client and nothing else.
    fn contain(&mut self, ctx: &mut Context<Self>, work: impl FnOnce(&mut Self)) {
        if let Err(panic) = contain(|| work(self)) {
            tracing::error!(%panic, "a client's actor failed; its connection ends");
            ctx.stop();
        }
    }
}
