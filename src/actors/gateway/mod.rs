//! The gateway stands between the sockets and the nodes: a listener, an actor for each connection, and the registry.
//!
//! **Invariant:** the runtime's own names come from the catalog, and no client's input stops the service of others.

pub mod connection;
mod ends;
pub mod files;
pub mod limits;
pub mod listener;
pub mod messages;
pub mod registry;
pub(super) mod unbound;
