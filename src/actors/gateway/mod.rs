//! The gateway stands between the sockets and the nodes: a listener, an actor for each connection, and the registry.
//!
//! **Invariant:** what is the arm's own is read from the catalog, and whatever a client sends, the others are served.

pub mod connection;
mod ends;
pub mod files;
pub mod limits;
pub mod listener;
pub mod messages;
pub mod registry;
pub(super) mod unbound;
