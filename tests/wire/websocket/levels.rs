//! `set_level`: from which level on a client is sent statuses, over WebSocket and over TCP.

use crate::common::Runtime;
use crate::web_client::Socket;
use serde_json::{Value, json};

#[test]
fn no_status_comes_before_the_client_has_asked_for_such() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "subscribe", "topic": "/chat", "id": 1}));
    socket.send(&json!({"op": "nonsense"}));
    socket.send(&json!({"op": "publish", "topic": "/joint_states", "msg": {}}));
    socket.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {}}));
    socket.send(&json!({"op": "set_level", "level": "loud"}));
    socket.send(&json!({"op": "subscribe", "topic": 7}));
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.send_text("not JSON");
    socket.send_text("");
    socket.settle();
}

#[test]
fn statuses_come_from_the_level_on_that_the_client_has_set() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let subscribe = json!({"op": "subscribe", "topic": "/chat", "id": "s"});
    let bad = json!({"op": "publish", "topic": "/joint_trajectory", "msg": {}, "id": "b"});
    socket.send(&json!({"op": "set_level", "level": "info"}));
    socket.send(&subscribe);
    let status = socket.receive();
    let level = (&status["op"], &status["level"], &status["id"]);
    assert_eq!(level, (&json!("status"), &json!("info"), &json!("s")));
    for level in ["warning", "error"] {
        socket.send(&json!({"op": "set_level", "level": level}));
        socket.send(&subscribe);
        socket.send(&bad);
        let status = socket.receive();
        assert_eq!(
            (&status["level"], &status["id"]),
            (&json!("error"), &json!("b"))
        );
    }
    socket.send(&json!({"op": "set_level", "level": "none"}));
    socket.send(&subscribe);
    socket.send(&bad);
    socket.settle();
}

#[test]
fn over_tcp_statuses_come_until_the_client_sets_another_level() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/chat");
    client.send(&json!({"op": "set_level", "level": "error"}));
    client.send(&json!({"op": "subscribe", "topic": "/chat"}));
    client.send(&json!({"op": "nonsense", "id": 5}));
    assert_eq!(client.receive()["id"], 5);
    client.send(&json!({"op": "set_level", "level": "none"}));
    client.send(&json!({"op": "nonsense"}));
    client.send(&json!({"op": "set_level", "level": "nonsense"}));
    client.send_bytes(b"[]\n");
    client.settle();
    assert_eq!(client.kept, Vec::<Value>::new());
    client.send(&json!({"op": "set_level", "level": "warning"}));
    client.send(&json!({"op": "set_level", "level": 3, "id": 6}));
    let status = client.receive();
    assert_eq!(status["id"], 6);
    assert!(
        status["msg"]
            .as_str()
            .unwrap()
            .contains("info, warning, error or none")
    );
}
