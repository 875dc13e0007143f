//! The rosbridge side: bytes and JSON in and out.
//!
//! **Invariant:** no sockets, no clock, no physics in here; functions that depend on time take it as
//! an argument.

pub mod catalog;
pub mod limits;
pub mod messages;
pub mod names;
pub mod op;
pub mod outbox;
pub mod ros;
pub mod wire;
