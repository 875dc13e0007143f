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
mod deadlines;
#[cfg(feature = "web")]
mod http;
mod reader;
mod session;
#[cfg_attr(
    not(feature = "web"),
    allow(dead_code, reason = "only an HTTP request opens a WebSocket")
)]
mod transport;
mod websocket;

use std::future::ready;
use std::mem::replace;
use std::pin::Pin;
use std::sync::Arc;

use actix::fut::wrap_future;
use actix::prelude::*;

use self::admission::Admission;
use self::client::ClientWriter;
pub use self::client::Connection;
use self::deadlines::Discarder;
use self::reader::ClientReader;
use self::session::{ClientSession, Opened};
pub use self::transport::ClientStream;
use super::limits::{DISCARD_TIME, LINGER};
use super::registry::{Outlets, Registry};
use crate::actors::panics::{Contained, contained};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::unread;
pub use crate::actors::resources::unread::Ends;
use crate::protocol::outbox::flow::UnreadSource;

impl<S: ClientStream> Connection<S> {
    /// Starts the actor for `stream` in the current system. It requires no token.
    pub fn start_on(stream: S, registry: Addr<Registry>, gauges: Arc<Gauges>) -> Addr<Self> {
        let (admission, ends) = (Arc::default(), Ends::default());
        Self::start_with(None, admission, ends, stream, registry, gauges)
    }

    /// Starts the actor for a client that must be admitted. If `unread` is given, it returns the client's unread bytes.
    /// Otherwise the system does.
    pub fn start_with(
        unread: Option<UnreadSource>,
        admission: Arc<Admission>,
        ends: impl Into<Ends>,
        stream: S,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Addr<Self> {
        let ends = ends.into();
        let unread = unread.unwrap_or_else(|| Box::new(unread::source(ends)));
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
            .then(|(), connection: &mut Self, _| {
                connection.leave();
                ActorFutureExt::<Self>::timeout(Discarder::default(), DISCARD_TIME)
            })
            .map(|_, connection, ctx| connection.end_half(ctx));
        Self::run("reader", reading, ctx);
        let writing = ClientWriter::default().map(|is_all_written, connection: &mut Self, ctx| {
            if is_all_written && (connection.is_refused || connection.is_socket()) {
                ctx.run_later(LINGER, |_, ctx| ctx.stop());
                connection.end_half(ctx);
            } else {
                ctx.stop();
            }
        });
        Self::run("writer", writing, ctx);
    }

    /// Ends the connection if the reader and the writer have ended.
    fn end_half(&mut self, ctx: &mut Context<Self>) {
        if replace(&mut self.half_has_ended, true) {
            ctx.stop();
        }
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

    /// Ends the connection after a panic in `part` of it.
    fn fail(part: &str, panic: &Contained, ctx: &mut Context<Self>) {
        tracing::error!(%panic, "a client's {part} failed; its connection ends");
        ctx.stop();
    }
}
