//! The two ends of a connection, and its end.
//!
//! **Invariant:** if one end is unknown, the client counts as local.

use std::net::{Ipv4Addr, SocketAddr};

/// The two addresses of a client's connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ends {
    /// The runtime's.
    pub local: SocketAddr,
    /// The client's.
    pub peer: SocketAddr,
}

/// Unknown ends, as of a local client.
impl Default for Ends {
    fn default() -> Self {
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into()
    }
}

/// A local client.
impl From<SocketAddr> for Ends {
    fn from(local: SocketAddr) -> Self {
        let peer = local;
        Self { local, peer }
    }
}

/// Why a client can no longer be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ClientLost {
    /// It has disconnected.
    Gone,
    /// It has violated a rule, and gets an error at the end.
    #[cfg(feature = "web")]
    Refused,
}
