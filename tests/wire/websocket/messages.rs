//! Frames and messages: calls, topics and services over WebSocket, and between it and TCP.

use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use pendularm_client::websocket::{LAST, opcode};
use serde_json::json;

#[test]
fn a_call_is_answered_by_one_text_message() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let response = socket.call("/arm_sim/set_params", json!({"gravity": 3}));
    assert_eq!(response["values"]["gravity"], 3.0);
    assert_eq!(response["result"], true);
}

/// Clients of `rosbridge_suite` show `values` of a call that failed, and nothing else.
#[test]
fn a_call_that_failed_says_why_in_values_unless_the_client_asks_for_the_object() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let halfway = json!({"gravity": -1, "masses": [2, 2]});
    let calls = [
        ("/arm_sim/set_params", halfway.clone(), "gravity"),
        ("/ik/solve", json!({"x": 9, "y": 9}), "reach"),
        ("/ik/solve", json!("none"), "args"),
        ("/arm_sim/integration_step", json!({}), "function"),
        ("/no/such_service", json!({}), "no provider"),
    ];
    for (service, args, named) in calls.clone() {
        let response = socket.call(service, args);
        let (values, status) = (&response["values"], &response["status"]);
        assert_eq!((values, &response["result"]), (status, &json!(false)));
        assert!(status.as_str().unwrap().contains(named), "{response}");
    }
    socket.send(&json!({"op": "call_service", "service": "/ik/solve", "id": 1, "timeout": "soon"}));
    let response = socket.receive();
    assert_eq!(response["values"], response["status"]);
    assert!(response["values"].is_string(), "{response}");

    socket.send(&json!({"op": "set_level", "level": "none", "errors": "object"}));
    for (service, args, named) in calls {
        let response = socket.call(service, args);
        assert!(response["values"].is_object(), "{response}");
        assert!(response["status"].as_str().unwrap().contains(named));
    }
    let response = socket.call("/arm_sim/set_params", halfway.clone());
    assert_eq!(response["values"]["masses"], json!([2.0, 2.0]));

    let mut client = runtime.connect();
    assert!(client.call("/arm_sim/set_params", halfway.clone())["values"].is_object());
    client.send(&json!({"op": "set_level", "level": "info", "errors": "text"}));
    assert!(client.call("/arm_sim/set_params", halfway)["values"].is_string());
}

/// A provider's answer is its own, also where it is a failure.
#[test]
fn values_of_another_client_pass_as_they_are() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.send(&json!({"op": "call_service", "service": "/mine", "id": "a"}));
    let call = socket.receive();
    socket.send(
        &json!({"op": "service_response", "service": "/mine", "id": call["id"],
                        "values": {"a": 1}, "result": false}),
    );
    let response = socket.receive();
    assert_eq!(
        (&response["id"], &response["values"]),
        (&json!("a"), &json!({"a": 1}))
    );
}

#[test]
fn text_and_binary_messages_both_are_frames() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = r#"{"op":"call_service","service":"/arm_sim/pause","id":"a"}"#;
    socket.send_frame(LAST | opcode::BINARY, frame.as_bytes());
    assert_eq!(socket.receive()["id"], "a");
    socket.send_text(frame);
    assert_eq!(socket.receive()["id"], "a");
}

#[test]
fn a_message_in_fragments_is_one_frame_also_with_a_ping_between_them() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = br#"{"op":"call_service","service":"/arm_sim/pause","id":1}"#;
    socket.send_frame(opcode::TEXT, &frame[..10]);
    socket.send_frame(LAST | opcode::PING, b"hello");
    socket.send_frame(opcode::CONTINUATION, &frame[10..11]);
    socket.send_frame(LAST | opcode::CONTINUATION, &frame[11..]);
    assert_eq!(socket.event(), Event::Pong(b"hello".to_vec()));
    assert_eq!(socket.receive()["id"], 1);
}

#[test]
fn topics_go_both_ways_between_tcp_and_websocket() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut client = runtime.connect();
    socket.send(&json!({"op": "subscribe", "topic": "/chat"}));
    socket.send(&json!({"op": "advertise", "topic": "/reply"}));
    socket.settle();
    client.subscribe("/reply");
    client.send(&json!({"op": "advertise", "topic": "/chat"}));
    client.send(&json!({"op": "publish", "topic": "/chat", "msg": {"data": "hello"}}));
    let expected = json!({"op": "publish", "topic": "/chat", "msg": {"data": "hello"}});
    assert_eq!(socket.receive(), expected);
    socket.send(&json!({"op": "publish", "topic": "/reply", "msg": {"data": [1, 2]}}));
    assert_eq!(client.message("/reply"), json!({"data": [1, 2]}));
}

#[test]
fn a_client_may_provide_a_service_over_websocket() {
    let runtime = Runtime::start();
    let mut provider = Socket::open(runtime.address);
    provider.send(&json!({"op": "advertise_service", "service": "/double"}));
    provider.settle();
    let mut client = runtime.connect();
    client.send(&json!({"op": "call_service", "service": "/double", "args": {"n": 4}, "id": 9}));
    let call = provider.receive();
    assert_eq!(call["args"]["n"], 4);
    provider.send(&json!({
        "op": "service_response", "service": "/double", "id": call["id"], "values": {"n": 8}, "result": true
    }));
    let response = client.receive_where("an answer", |frame| frame["id"] == 9);
    assert_eq!(response["values"]["n"], 8);
}

#[test]
fn an_answer_of_many_megabytes_is_one_message() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let args = json!({"function": "sin(t)", "x0": 0.1, "dt": 0.001, "steps": 100_000, "integrator": "rk4"});
    let response = socket.call("/arm_sim/integration_step", args);
    assert_eq!(
        response["values"]["positions"].as_array().unwrap().len(),
        100_001
    );
    socket.settle();
}
