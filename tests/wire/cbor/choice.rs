//! The encoding that counts: of several subscriptions, and over raw TCP.

use super::decoder::Cbor;
use super::paused;
use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use serde_json::json;

#[test]
fn of_several_subscriptions_the_densest_encoding_counts_and_the_next_when_it_is_gone() {
    let (_runtime, mut socket) = paused();
    let subscribe = |compression: &str| json!({"op": "subscribe", "topic": "/clock", "id": compression, "compression": compression});
    socket.send(&subscribe("none"));
    assert_eq!(socket.receive()["topic"], "/clock");
    socket.send(&subscribe("cbor"));
    let awaited = |socket: &mut Socket, wanted: &dyn Fn(&Event) -> bool| {
        for _ in 0..200 {
            if wanted(&socket.event()) {
                return;
            }
        }
        panic!("it does not come");
    };
    let raw = |message: &Event| matches!(message, Event::Binary(bytes) if matches!(Cbor::read(bytes).get("msg"), Cbor::Map(members) if members.len() == 3));
    awaited(&mut socket, &|message| {
        matches!(message, Event::Binary(_)) && !raw(message)
    });
    socket.send(&subscribe("cbor-raw"));
    awaited(&mut socket, &raw);
    socket.send(&json!({"op": "unsubscribe", "topic": "/clock", "id": "cbor-raw"}));
    awaited(&mut socket, &|message| {
        matches!(message, Event::Binary(_)) && !raw(message)
    });
    socket.send(&json!({"op": "unsubscribe", "topic": "/clock", "id": "cbor"}));
    awaited(&mut socket, &|message| matches!(message, Event::Text(_)));
}

#[test]
fn over_raw_tcp_binary_is_refused_and_png_comes_as_it_is() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (compression, word) in [
        ("cbor", "WebSocket"),
        ("cbor-raw", "WebSocket"),
        ("zip", "compression"),
    ] {
        client.send(&json!({"op": "subscribe", "topic": "/clock", "compression": compression}));
        let status = client.status();
        assert_eq!(status["level"], "error");
        assert!(status["msg"].as_str().unwrap().contains(word), "{status}");
    }
    for compression in ["none", "png"] {
        // Somebody new each time: nothing comes before the subscription is answered.
        let mut client = runtime.connect();
        client.send(&json!({"op": "subscribe", "topic": "/clock", "compression": compression}));
        assert_eq!(client.status()["level"], "info");
        client.message("/clock");
        assert!(client.kept.is_empty(), "{:?}", client.kept);
    }
}
