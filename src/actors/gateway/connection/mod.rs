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
use crate::actors::resources::memory::Memory;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client.
pub struct Connection<S> {
    /// The stream and the conditions of admission, until the session takes them.
    newcomer: Option<(S, Arc<Admission>)>,
    ends: Ends,
    registry: Addr<Registry>,
    /// The shared memory for long frames.
    memory: Memory,
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
        let memory = gauges.memory().clone();
        let client = ClientState::new(gauges, unread, registry.clone());
        Self {
            newcomer: Some((stream, admission)),
            ends,
            registry,
            memory,
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
        let outlets = Outlets {
            mailbox: ctx.address().recipient(),
            gone: Arc::new(AtomicBool::new(false)),
            backlog: Arc::clone(&self.client.borrow().backlog),
        };
        let session = ClientSession {
            registry: self.registry.clone(),
            finish: Arc::clone(&self.finish),
            admission,
            ends: self.ends,
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
        let first = (opened.transport.is_socket(), opened.first);
        client.borrow_mut().transport = Some(opened.transport);
        let reading: Pin<Box<dyn Future<Output = ()>>> = match opened.place {
            Ok(place) => {
                let (registry, memory) = (self.registry.clone(), self.memory.clone());
                let (ends, client) = (self.ends, Rc::clone(&client));
                Box::pin(ClientReader::new(client, registry, memory, (ends, place), first).run())
            }
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
