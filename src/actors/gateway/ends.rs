//! The two ends of a connection.
//!
//! **Invariant:** where one end is not known, the client counts as one of the same machine.

use std::net::{Ipv4Addr, SocketAddr};

/// The addresses between which a client has connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ends {
    /// Ours.
    pub local: SocketAddr,
    /// The client's.
    pub peer: SocketAddr,
}

/// Unknown ends: those of a client of the same machine.
impl Default for Ends {
    fn default() -> Self {
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into()
    }
}

/// A client of the same machine.
impl From<SocketAddr> for Ends {
    fn from(local: SocketAddr) -> Self {
        let peer = local;
        Self { local, peer }
    }
}
