//! Accepts clients on a bound socket, and gives each its connection actor.
//!
//! **Invariant:** an error of `accept`, such as too many open files or a client that has disconnected, never ends the
//! accept loop. The loop never spins.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::net::TcpListener;

use super::connection::admission::Admission;
use super::connection::{self, Ends};
use super::registry::Registry;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::listening::prepare;

/// Pause of the accept loop after an error. It prevents a busy loop, and clients do not notice it.
const BACKOFF: Duration = Duration::from_millis(50);

/// Accepts clients on a bound socket, and starts a connection for each. The runtime aborts it when it ends.
pub async fn accept(
    socket: TcpListener,
    admission: Arc<Admission>,
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
) {
    // An error is logged once, not twenty times a second.
    let mut failing = false;
    loop {
        match socket.accept().await {
            Ok((stream, peer)) => {
                if std::mem::take(&mut failing) {
                    tracing::info!("clients are accepted again");
                }
                if let Err(error) = prepare(&stream) {
                    tracing::debug!(%peer, %error, "a socket option was refused");
                }
                tracing::debug!(%peer, "client connected");
                let local = stream.local_addr().unwrap_or(Ends::default().local);
                let (admission, ends) = (Arc::clone(&admission), Ends { local, peer });
                let (registry, gauges) = (registry.clone(), Arc::clone(&gauges));
                connection::start(None, admission, ends, stream, registry, gauges);
            }
            Err(error) => {
                if !std::mem::replace(&mut failing, true) {
                    tracing::warn!(%error, "cannot accept a client; retrying");
                }
                actix_rt::time::sleep(BACKOFF).await;
            }
        }
    }
}
