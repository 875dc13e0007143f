//! The gateway stands between the sockets and the nodes: a listener, an actor for each connection, the registry, and
//! what each client holds.
//!
//! **Invariant:** nothing in here knows an arm, and whatever a client sends, the others are served.

pub mod aside;
pub mod awake;
pub mod budget;
pub mod connection;
pub mod encoded;
mod ends;
pub mod files;
pub mod gauges;
pub mod limits;
pub mod listener;
pub mod messages;
pub mod registry;
mod turns;
