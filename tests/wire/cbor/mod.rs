//! `compression`: the messages that subscribers over WebSocket get as CBOR and as CDR within CBOR.
//!
//! **Invariant:** binary messages are read here by a decoder of their own, written from the standards.

#![cfg(feature = "web")]
mod choice;
mod decoder;
mod raw;

use self::decoder::Cbor;
use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use serde_json::json;

/// The next binary message.
fn binary(socket: &mut Socket) -> Cbor {
    loop {
        match socket.event() {
            Event::Binary(bytes) => return Cbor::read(&bytes),
            Event::Pong(_) => {}
            other => panic!("not binary: {other:?}"),
        }
    }
}

fn subscribe(socket: &mut Socket, topic: &str, compression: &str) {
    socket.send(&json!({"op": "subscribe", "topic": topic, "compression": compression}));
}

/// The arm in its starting pose, paused, so that every encoding tells the same state.
fn paused() -> (Runtime, Socket) {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.call("/arm_sim/pause", json!({"data": true}));
    socket.call("/arm_sim/reset", json!({}));
    (runtime, socket)
}
