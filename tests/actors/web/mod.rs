//! HTTP and WebSocket in virtual time: missing heads, messages without an end, clients that do not read. Here the
//! client's end of a connection.
//!
//! **Invariant:** virtual time and in-memory pipes only; a time that is asserted is exact to the timers' grain.

#![cfg(feature = "web")]

mod heads;
mod http;
mod messages;
mod unread;

use std::cell::Cell;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Node, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::memory::Memory;
use pendularm::protocol::catalog::Service;
use pendularm_client::codec::Event;
use pendularm_client::pipe::Client;
use pendularm_client::websocket::{LAST, append, opcode};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};
use tokio::time::{Instant, sleep};

/// The client's end of a new connection.
fn connect(gateway: &Gateway, room: usize) -> DuplexStream {
    connect_through(gateway, &Arc::default(), room)
}

/// The same, with shared rules of admission.
fn connect_through(gateway: &Gateway, admission: &Arc<Admission>, room: usize) -> DuplexStream {
    let (ours, theirs) = duplex(room);
    let (registry, gauges) = (gateway.registry.clone(), Arc::clone(&gateway.gauges));
    let local = SocketAddr::from(([127, 0, 0, 1], 9095));
    Connection::start_with(Arc::clone(admission), local, theirs, registry, gauges);
    ours
}

async fn open(gateway: &Gateway, room: usize) -> Client<DuplexStream> {
    let stream = connect(gateway, room);
    Client::web_on(stream, Duration::from_secs(3600), "127.0.0.1:9095", "/").await
}

async fn send(socket: &mut Client<DuplexStream>, frame: Value) {
    socket.send(&frame).await;
}

/// The next message.
async fn receive(socket: &mut Client<DuplexStream>) -> Event {
    socket.next_event().await.expect("a message")
}

/// The same, which must be a text.
async fn receive_text(socket: &mut Client<DuplexStream>) -> String {
    match receive(socket).await {
        Event::Text(text) => text,
        other => panic!("{other:?} instead of a text"),
    }
}

/// Most bytes that are read or written before other tasks have a turn.
const TURN: usize = 64 * 1024;

/// The number of turns of other tasks during `doing`, and its result.
async fn turns_of_others<T>(doing: impl Future<Output = T>) -> (usize, T) {
    let turns = Rc::new(Cell::new(0));
    let counted = Rc::clone(&turns);
    let others = actix_rt::spawn(async move {
        loop {
            counted.set(counted.get() + 1);
            tokio::task::yield_now().await;
        }
    });
    let done = doing.await;
    others.abort();
    (turns.get(), done)
}
