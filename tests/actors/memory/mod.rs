//! Memory that all clients together may hold: who gives way when it is too much, and that nobody else does. In virtual
//! time, but for `computations.rs`.
//!
//! **Invariant:** a client that asks for little and reads what it gets is served whatever the others do.

mod accounts;
mod clients;
mod computations;

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Peer, WIDE, settle};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::budget::{MODEST, Memory};
use serde_json::json;

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;
