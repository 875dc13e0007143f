//! The gateway connects the sockets to the nodes. It has a listener, an actor for each connection, and the registry.
//!
//! **Invariant:** the runtime's own names come from the catalog. No client's input stops the service of others.

pub mod connection;
pub mod limits;
pub mod listener;
pub mod registry;
