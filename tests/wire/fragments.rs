//! `fragment`: long frames in pieces, from clients always, to clients only where they asked for it.
//!
//! **Invariant:** pieces put together here are the frame that the same subscription without pieces gives.

use crate::common::Runtime;
use serde_json::{Value, json};

fn pieces(frame: &str, size: usize, id: &Value) -> Vec<Value> {
    let bytes: Vec<String> = frame
        .as_bytes()
        .chunks(size)
        .map(|chunk| String::from_utf8(chunk.to_vec()).expect("ASCII"))
        .collect();
    let total = bytes.len();
    let numbered = bytes.into_iter().enumerate();
    numbered
        .map(|(num, data)| json!({"op": "fragment", "id": id, "data": data, "num": num, "total": total}))
        .collect()
}

#[test]
fn a_frame_in_pieces_is_performed_once_all_are_there_in_whatever_order() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let frame = json!({"op": "call_service", "service": "/arm_sim/set_params", "id": "whole",
        "args": {"gravity": 2.5}});
    let mut all = pieces(&frame.to_string(), 16, &json!("a"));
    all.reverse();
    let last = all.pop().unwrap();
    for piece in all {
        client.send(&piece);
    }
    assert_eq!(
        client.ask("/arm_sim/set_params", json!({}))["gravity"],
        9.81
    );
    client.send(&last);
    let response = client.receive();
    assert_eq!(
        (&response["id"], &response["values"]["gravity"]),
        (&json!("whole"), &json!(2.5))
    );
}

#[test]
fn pieces_that_make_no_frame_cost_an_error_status_and_nothing_else() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let nested = json!({"op": "fragment", "id": 1, "data": "{}", "num": 0, "total": 1});
    let deep = format!("{{\"op\":{}", "[".repeat(200));
    let pause = json!({"op": "call_service", "service": "/arm_sim/pause", "args": {"data": true}});
    for text in [
        "no frame".to_owned(),
        "{\"op\":".to_owned(),
        nested.to_string(),
        deep,
        format!("{pause} {pause}"),
        format!("{pause}\n{pause}"),
        format!("{pause} more"),
    ] {
        for piece in pieces(&text, 8, &json!(7)) {
            client.send(&piece);
        }
        let status = client.receive();
        assert_eq!(
            (&status["level"], &status["id"]),
            (&json!("error"), &json!(7)),
            "{text}"
        );
    }
    for bad in [
        json!({"op": "fragment", "id": 1, "data": "x", "num": 2, "total": 2}),
        json!({"op": "fragment", "id": 1, "data": "x", "num": 0, "total": 1e9}),
        json!({"op": "fragment", "id": 1, "data": 5, "num": 0, "total": 2}),
        json!({"op": "fragment", "id": 1, "num": 0, "total": 2}),
        json!({"op": "fragment", "data": "x", "num": 0, "total": 2}),
        json!({"op": "fragment", "id": 1, "data": "x", "num": -1, "total": 2}),
    ] {
        client.send(&bad);
        assert_eq!(client.receive()["level"], "error", "{bad}");
    }
    client.settle();
}

#[test]
fn a_subscriber_gets_pieces_only_where_it_asked_for_them() {
    let runtime = Runtime::start();
    let (mut small, mut whole) = (runtime.connect(), runtime.connect());
    small.send(&json!({"op": "subscribe", "topic": "/joint_states", "fragment_size": 100}));
    assert_eq!(small.status()["level"], "info");
    // Short enough as it is.
    small.send(&json!({"op": "subscribe", "topic": "/clock", "fragment_size": 4000}));
    assert_eq!(
        small.receive_where("the status", |frame| frame["op"] == "status")["level"],
        "info"
    );
    whole.subscribe("/joint_states");
    whole.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "args": {"data": true}}));
    assert_eq!(small.message("/clock")["clock"]["sec"], 0);

    let first = small.receive_where("a first piece", |frame| {
        frame["op"] == "fragment" && frame["num"] == 0
    });
    let total = first["total"].as_u64().expect("an integer");
    assert!(first["id"].is_string() && total > 1, "{first}");
    let mut text = first["data"].as_str().unwrap().to_owned();
    for num in 1..total {
        let piece = small.receive_where("the next piece", |frame| frame["op"] == "fragment");
        assert_eq!((&piece["num"], &piece["id"]), (&json!(num), &first["id"]));
        let data = piece["data"].as_str().unwrap();
        assert!(data.len() <= 100);
        text.push_str(data);
    }
    let frame: Value = serde_json::from_str(&text).expect("the pieces make a frame");
    assert_eq!(frame["topic"], "/joint_states");
    assert_eq!(frame["msg"]["name"], whole.message("/joint_states")["name"]);
}

#[test]
fn a_throttle_counts_messages_not_pieces() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(
        &json!({"op": "subscribe", "topic": "/joint_states", "fragment_size": 64,
        "throttle_rate": 100}),
    );
    client.status();
    for _ in 0..3 {
        let first = client.receive();
        assert_eq!(first["num"], 0);
        for num in 1..first["total"].as_u64().unwrap() {
            assert_eq!(client.receive()["num"], num);
        }
    }
}

#[test]
fn a_bad_fragment_size_is_refused_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for size in [json!(0), json!(-1), json!("x"), json!(1.5)] {
        client.send(&json!({"op": "subscribe", "topic": "/clock", "fragment_size": size}));
        let status = client.status();
        assert!(
            status["msg"].as_str().unwrap().contains("fragment_size"),
            "{status}"
        );
    }
}
