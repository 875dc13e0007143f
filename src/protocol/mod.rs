//! The rosbridge protocol: bytes and JSON in and out.
//!
//! **Invariant:** this module has no sockets, no clock and no physics. Functions that depend on time
//! take it as an argument.

pub mod catalog;
pub mod limits;
pub mod messages;
pub mod names;
pub mod op;
pub mod outbox;
pub mod ros;
pub mod wire;
