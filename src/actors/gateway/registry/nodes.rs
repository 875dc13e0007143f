//! The table that the runtime hands to the registry: which node serves what.
//!
//! **Invariant:** the registry takes the whole table at once.

use actix::prelude::*;

pub use crate::actors::wire::Nodes;

/// The runtime's nodes. From the runtime, once, before any client is accepted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Attach(pub Nodes);
