//! One client: its bytes become ops for the registry. Messages and responses return through a bounded outbox.
//!
//! A session detects the protocol from the first bytes. Then the actor has two futures with access to its state. The
//! reader sends one op at a time to the registry and waits until it has taken effect. The writer drains the outbox,
//! which the registry's messages fill. A client that reads slowly fills only its own outbox.
//!
//! The connection is generic over the stream, so that tests can use an in-memory pipe and run in virtual time.
//!
//! **Invariant:** responses and statuses are never dropped. While too many wait, the client is not read.

pub mod admission;
mod client;
#[cfg(feature = "web")]
mod http;
mod reader;
mod session;
#[cfg_attr(
    not(feature = "web"),
    allow(dead_code, reason = "only an HTTP request opens a WebSocket")
)]
mod transport;

use std::future::ready;
use std::pin::Pin;
use std::sync::Arc;

use actix::fut::wrap_future;
use actix::prelude::*;

use self::admission::Admission;
use self::client::ClientWriter;
pub use self::client::Connection;
use self::reader::{ClientReader, Discarder};
use self::session::{ClientSession, Opened};
pub use self::transport::ClientStream;
use super::limits::DISCARD_TIME;
use super::registry::{Outlets, Registry};
use crate::actors::panics::contained;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::unread;
pub use crate::actors::resources::unread::Ends;
use crate::protocol::outbox::flow::UnreadSource;

impl<S: ClientStream> Connection<S> {
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
        let unread = Box::new(unread::source(ends));
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
        Self::create(|ctx| {
            let connection = Self::new(ends, unread, registry, gauges);
            let outlets = Outlets {
                mailbox: ctx.address().recipient(),
                backlog: Arc::clone(&connection.backlog),
                gone: Arc::clone(&connection.gone),
            };
            let session = ClientSession {
                registry: connection.registry.clone(),
                admission,
                ends,
                outlets,
            };
            let opening = wrap_future(session.run(stream));
            let opening = opening.map(|opened, connection: &mut Self, ctx| match opened {
                Some(opened) => connection.converse(opened, ctx),
                None => ctx.stop(),
            });
            Self::run("session", opening, ctx);
            connection
        })
    }

    /// Reads and writes until the client disconnects, or has received all its messages.
    fn converse(&mut self, opened: Opened<S>, ctx: &mut Context<Self>) {
        self.transport = Some(opened.transport);
        let reading: Pin<Box<dyn ActorFuture<Self, Output = ()>>> = match opened.place {
            Ok(place) => {
                let reader = ClientReader::new(place.id, opened.first);
                self.place = Some(place);
                Box::pin(reader)
            }
            Err(status) => {
                self.refuse_with(status);
                self.is_finishing = true;
                Box::pin(wrap_future(ready(())))
            }
        };
        let reading = reading
            .then(|(), _, _| ActorFutureExt::<Self>::timeout(Discarder::default(), DISCARD_TIME))
            .map(|_, connection, _| connection.reader_has_ended = true);
        Self::run("reader", reading, ctx);
        let writing = ClientWriter::default().map(|(), _: &mut Self, ctx| ctx.stop());
        Self::run("writer", writing, ctx);
    }

    /// Runs a part of the connection. A panic ends only this connection.
    fn run(
        part: &'static str,
        task: impl ActorFuture<Self, Output = ()> + 'static,
        ctx: &mut Context<Self>,
    ) {
        ctx.spawn(contained(task).map(move |ended, _, ctx| {
            if let Err(panic) = ended {
                Self::fail(part, &panic, ctx);
            }
        }));
    }
}
