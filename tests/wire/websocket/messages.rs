//! Frames and messages: calls, topics and services over WebSocket, and between it and TCP.

use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use pendularm_client::websocket::{LAST, opcode};
use serde_json::json;

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
