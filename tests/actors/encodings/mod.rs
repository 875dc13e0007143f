//! Messages in the forms that subscribers request, and frames that are read on another thread, in virtual time.
//!
//! **Invariant:** messages that another thread encodes keep their order, which is checked with every message.

mod long_frames;
mod losses;
mod order;

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Peer, WIDE};
use serde_json::{Value, json};
use tokio::time::sleep;

async fn subscribe_in_pieces(peer: &mut Peer, size: usize) -> Value {
    peer.send(json!({"op": "subscribe", "topic": "/t", "fragment_size": size}))
        .await;
    peer.receive().await
}

/// The next message, joined if it comes in pieces, and the number of its fragments' id. The number is 0 without
/// fragments.
async fn next_message(peer: &mut Peer) -> (Value, u64) {
    let mut text = String::new();
    loop {
        let frame = peer.receive().await;
        if frame["op"] != "fragment" {
            assert!(text.is_empty(), "nothing comes between two pieces");
            return (frame, 0);
        }
        text.push_str(frame["data"].as_str().unwrap());
        if frame["num"].as_u64().unwrap() + 1 == frame["total"].as_u64().unwrap() {
            let id = frame["id"].as_str().unwrap();
            let number = id.strip_prefix("pendularm:").unwrap().parse().unwrap();
            return (serde_json::from_str(&text).unwrap(), number);
        }
    }
}

async fn publish_long(peer: &mut Peer, topic: &str) {
    let msg = json!({"pad": "x".repeat(2000)});
    peer.send(json!({"op": "publish", "topic": topic, "msg": msg}))
        .await;
}
