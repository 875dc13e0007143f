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
mod client;
mod flow;
#[cfg(feature = "web")]
mod http;
mod reader;
mod session;
#[cfg_attr(
    not(feature = "web"),
    allow(dead_code, reason = "only an HTTP request opens a WebSocket")
)]
mod transport;
mod turns;

use std::cell::RefCell;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actix::prelude::*;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::Notify;

use self::admission::Admission;
use self::client::ClientState;
pub use self::flow::{Ends, UnreadSource};
use self::reader::{ClientReader, discard_input};
use self::session::{ClientSession, Opened};
use super::registry::{Outlets, Registry, ToClient};
use crate::actors::panics::{contain, contained};
use crate::actors::resources::gauges::Gauges;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client.
pub struct Connection<S> {
    /// The stream and the conditions of admission, until the session takes them.
    newcomer: Option<(S, Arc<Admission>)>,
    client: Rc<RefCell<ClientState<S>>>,
    /// Notifies the session that the runtime is ending.
    finish: Arc<Notify>,
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
        let client = ClientState::new(ends, unread, registry, gauges);
        Self {
            newcomer: Some((stream, admission)),
            client: Rc::new(RefCell::new(client)),
            finish: Arc::default(),
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
        let client = self.client.borrow();
        let outlets = Outlets {
            mailbox: ctx.address().recipient(),
            gone: Arc::new(AtomicBool::new(false)),
            backlog: Arc::clone(&client.backlog),
        };
        let session = ClientSession {
            registry: client.registry.clone(),
            finish: Arc::clone(&self.finish),
            admission,
            ends: client.ends,
            outlets,
        };
        let opened = contained(session.run(stream)).into_actor(self);
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
        if matches!(message, ToClient::Finish) {
            self.finish.notify_one();
        }
        if let Err(panic) = contain(|| self.client.borrow_mut().accept(message)) {
            tracing::error!(%panic, "a client's actor failed; its connection ends");
            ctx.stop();
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Reads and writes until the client disconnects, or has received all its messages.
    fn converse(&self, opened: Opened<S>, ctx: &mut Context<Self>) {
        let client = Rc::clone(&self.client);
        client.borrow_mut().transport = Some(opened.transport);
        let reading: Pin<Box<dyn Future<Output = ()>>> = match opened.place {
            Ok(place) => Box::pin(ClientReader::new(&client, place, opened.first).run()),
            Err(why) => {
                client.borrow_mut().refuse(&why);
                client.borrow_mut().is_finishing = true;
                Box::pin(discard_input(Rc::clone(&client)))
            }
        };
        let reading = contained(reading).into_actor(self);
        ctx.spawn(reading.map(|ended, connection, ctx| match ended {
            Ok(()) => connection.client.borrow_mut().is_read_to_its_end = true,
            Err(panic) => {
                tracing::error!(%panic, "a client's reader failed; its connection ends");
                ctx.stop();
            }
        }));
        let writing = contained(client::write(client)).into_actor(self);
        ctx.spawn(writing.map(|ended, _, ctx| {
            if let Err(panic) = ended {
                tracing::error!(%panic, "a client's writer failed; its connection ends");
            }
            ctx.stop();
        }));
    }
}
