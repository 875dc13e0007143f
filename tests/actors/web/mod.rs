//! HTTP and WebSocket in virtual time: missing heads, messages without an end, clients that do not read. Here the
//! client's end of a connection.
//!
//! **Invariant:** virtual time and in-memory pipes only; a time that is asserted is exact to the timers' grain.

#![cfg(feature = "web")]

mod http;
mod messages;

use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, route, settle, turns_of_others};
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::node::ServiceCall;
use pendularm::protocol::catalog::Service;
use pendularm_client::pipe::Client;
use pendularm_client::websocket::{LAST, append, opcode};
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio::time::{Instant, sleep};

/// The client's end of a new connection.
fn connect(gateway: &Gateway, room: usize) -> DuplexStream {
    gateway.open(Arc::default(), room)
}

async fn open(gateway: &Gateway, room: usize) -> Client<DuplexStream> {
    let stream = connect(gateway, room);
    Client::web_on(stream, Duration::from_secs(3600)).await
}

/// Most bytes that are read or written before other tasks have a turn.
const TURN: usize = 64 * 1024;
/// Most frames that are read before other tasks have a turn.
const FRAMES_IN_A_TURN: usize = 64;
