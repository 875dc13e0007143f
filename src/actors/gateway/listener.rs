//! Accepts clients and gives each its connection actor.
//!
//! **Invariant:** an error of `accept` (too many open files, a client gone already) never ends the listening and never
//! spins.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use socket2::{SockRef, TcpKeepalive};
use tokio::net::{TcpListener, TcpSocket, TcpStream};

use super::connection::Connection;
use super::connection::admission::Admission;
use super::ends::Ends;
use super::registry::Registry;
use crate::actors::resources::gauges::Gauges;

/// Bytes that the system keeps for a client that does not read, beside as many of its own.
pub const SEND_BUFFER: u32 = 128 * 1024;
/// Connections that wait to be accepted.
pub const BACKLOG: u32 = 1024;
/// How long accepting rests after an error: long enough not to spin, short enough that clients don't notice.
const BACKOFF: Duration = Duration::from_millis(50);
/// After this time of silence a client's machine is asked whether it is still there. That is seldom enough to cost
/// nothing, and often enough for a router in between to keep the connection.
pub const KEEPALIVE_IDLE: Duration = Duration::from_secs(60);
/// Time between two such questions, and how many may go unanswered: a client survives half a minute without a network.
pub const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(15);
/// See [`KEEPALIVE_INTERVAL`].
pub const KEEPALIVE_PROBES: u32 = 4;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor that owns one listening socket.
pub struct Listener {
    socket: Arc<TcpListener>,
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
    admission: Arc<Admission>,
}

impl Listener {
    /// A listener on a socket that is bound already; nothing is asked of its clients first.
    #[must_use]
    pub fn new(socket: TcpListener, registry: Addr<Registry>, gauges: Arc<Gauges>) -> Self {
        Self::with(Arc::default(), socket, registry, gauges)
    }

    /// A listener that admits clients on these conditions.
    #[must_use]
    pub fn with(
        admission: Arc<Admission>,
        socket: TcpListener,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Self {
        Self {
            socket: Arc::new(socket),
            registry,
            gauges,
            admission,
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// No more clients are accepted. From the runtime, when it ends.
#[derive(Message)]
#[rtype(result = "()")]
pub struct StopListening;

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Listener {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        let accepting = accept(
            Arc::clone(&self.socket),
            self.registry.clone(),
            Arc::clone(&self.gauges),
            Arc::clone(&self.admission),
        );
        ctx.spawn(accepting.into_actor(self));
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<StopListening> for Listener {
    type Result = ();

    fn handle(&mut self, _: StopListening, ctx: &mut Context<Self>) {
        ctx.stop();
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

async fn accept(
    socket: Arc<TcpListener>,
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
    admission: Arc<Admission>,
) {
    // Logged once, not twenty times a second.
    let mut failing = false;
    loop {
        match socket.accept().await {
            Ok((stream, peer)) => {
                if std::mem::take(&mut failing) {
                    tracing::info!("clients are accepted again");
                }
                if let Err(error) = prepare(&stream) {
                    tracing::debug!(%peer, %error, "a socket option refused");
                }
                tracing::debug!(%peer, "client connected");
                let local = stream.local_addr().unwrap_or(Ends::default().local);
                let (registry, gauges) = (registry.clone(), Arc::clone(&gauges));
                let ends = Ends { local, peer };
                Connection::start_with(Arc::clone(&admission), ends, stream, registry, gauges);
            }
            Err(error) => {
                if !std::mem::replace(&mut failing, true) {
                    tracing::warn!(%error, "cannot accept a client; trying again and again");
                }
                actix_rt::time::sleep(BACKOFF).await;
            }
        }
    }
}

fn prepare(stream: &TcpStream) -> std::io::Result<()> {
    // Small frames must not wait for one another's acknowledgements.
    stream.set_nodelay(true)?;
    // Nothing else tells a silent client from one whose machine is gone.
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_IDLE)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}

/// Binds a TCP socket in the present runtime, and listens.
///
/// # Errors
/// The operating system's, for instance when the port is in use.
pub fn bind(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4(),
        SocketAddr::V6(_) => TcpSocket::new_v6(),
    }?;
    // A port that was just given up may be taken at once.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    // Accepted sockets have it too.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

#[cfg(test)]
mod tests {
    use std::net::TcpStream;

    use super::*;

    #[tokio::test]
    async fn many_clients_may_wait_to_be_accepted_and_their_send_buffers_are_small() {
        const { assert!(BACKLOG >= 300) };
        let socket = bind("127.0.0.1:0".parse().unwrap()).unwrap();
        let address = socket.local_addr().unwrap();
        let waiting: Vec<_> = (0..300)
            .map(|_| TcpStream::connect_timeout(&address, Duration::from_millis(900)).unwrap())
            .collect();
        let (stream, _) = socket.accept().await.unwrap();
        let size = SockRef::from(&stream).send_buffer_size().unwrap();
        assert!(size <= 2 * SEND_BUFFER as usize, "{size}");
        drop(waiting);
    }
}
