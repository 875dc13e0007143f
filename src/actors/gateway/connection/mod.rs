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
mod detection;
#[cfg(feature = "web")]
mod http;
mod reader;
#[cfg_attr(
    not(feature = "web"),
    allow(dead_code, reason = "only an HTTP request opens a WebSocket")
)]
mod transport;
mod writer;

use std::pin::Pin;
use std::sync::Arc;
use std::task::{self, Poll};

use actix::fut::wrap_future;
use actix::prelude::*;

use self::admission::{Admission, ClientSession, Opened};

pub use self::client::Connection;
use self::reader::ClientReader;
pub use self::transport::ClientStream;
use self::writer::ClientWriter;
use super::registry::{Outlets, Registry};
use crate::actors::panics::contain;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::unread;
pub use crate::actors::resources::unread::Ends;
use crate::protocol::outbox::flow::UnreadSource;

/// Starts the actor for `stream` in the current system. If `unread` is given, it returns the client's unread bytes.
/// Otherwise the system does.
pub fn start<S: ClientStream>(
    unread: Option<UnreadSource>,
    admission: Arc<Admission>,
    ends: impl Into<Ends>,
    stream: S,
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
) -> Addr<Connection<S>> {
    let ends = ends.into();
    let unread = unread.unwrap_or_else(|| Box::new(unread::source(ends)));
    Connection::create(|ctx| {
        let connection = Connection::new(ends, unread, registry, gauges);
        let outlets = Outlets {
            mailbox: ctx.address().recipient(),
            backlog: Arc::clone(&connection.backlog),
            gone: connection.gone.clone(),
        };
        let session = ClientSession {
            registry: connection.registry.clone(),
            admission,
            ends,
            outlets,
        };
        let opening = wrap_future(Box::pin(detection::open(session, stream)));
        let opening = opening.map(|opened, connection: &mut Connection<S>, ctx| match opened {
            Some(opened) => converse(connection, opened, ctx),
            None => ctx.stop(),
        });
        ctx.spawn(Part("session", opening));
        connection
    })
}

/// Reads and writes until the client disconnects, or has received all its messages.
fn converse<S: ClientStream>(
    connection: &mut Connection<S>,
    opened: Opened<S>,
    ctx: &mut Context<Connection<S>>,
) {
    connection.transport = Some(opened.transport);
    let reader = match opened.place {
        Ok(place) => {
            let reader = ClientReader::new(place.id, opened.first);
            connection.place = Some(place);
            reader
        }
        Err(status) => {
            connection.refuse_with(status);
            ClientReader::discarding(connection)
        }
    };
    ctx.spawn(Part("reader", reader));
    ctx.spawn(Part("writer", ClientWriter::default()));
}

/// A future of the connection, with its name. A panic in it ends only this connection.
struct Part<F>(&'static str, F);

impl<S: ClientStream, F: ActorFuture<Connection<S>, Output = ()> + Unpin> ActorFuture<Connection<S>>
    for Part<F>
{
    type Output = ();

    fn poll(
        mut self: Pin<&mut Self>,
        connection: &mut Connection<S>,
        ctx: &mut Context<Connection<S>>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let future = Pin::new(&mut self.1);
        contain(|| future.poll(connection, ctx, cx)).unwrap_or_else(|panic| {
            Connection::fail(self.0, &panic, ctx);
            Poll::Ready(())
        })
    }
}
