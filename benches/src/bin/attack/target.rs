//! The server that is attacked, as the clients beside the attack know it.
//!
//! **Invariant:** all of them are given the same.

use std::net::SocketAddr;
use std::time::Duration;

use pendularm_benches::protocol::Protocol;

/// A server, and what it asks.
#[derive(Clone, Copy)]
pub struct Target {
    pub protocol: Protocol,
    pub address: SocketAddr,
    pub locked: bool,
    pub patience: Duration,
}
