//! `cbor`: numbers to the last bit, typed arrays, and messages of clients.

use super::decoder::Cbor;
use super::{binary, paused, subscribe};
use crate::common::Runtime;
use crate::web_client::Socket;
use serde_json::json;

/// Decimal fractions on which a reader that rounds twice is off by the last bit: what is encoded is what Rust's own parser reads.
#[test]
fn a_double_of_a_client_arrives_to_the_last_bit() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut client = runtime.connect();
    subscribe(&mut socket, "/x", "cbor");
    socket.settle();
    client.send(&json!({"op": "advertise", "topic": "/x"}));
    for text in [
        "31.245270191439438",
        "121.48791951161945",
        "100.78399658203125",
        "0.30000000000000004",
        "5e-324",
        "1.7976931348623157e308",
        "2.2250738585072011e-308",
    ] {
        let frame =
            format!("{{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":{{\"data\":{text}}}}}\n");
        client.send_bytes(frame.as_bytes());
        let expected: f64 = text.parse().unwrap();
        match binary(&mut socket).get("msg").get("data") {
            Cbor::Float(value) => assert_eq!(value.to_bits(), expected.to_bits(), "{text}"),
            other => panic!("no double: {other:?}"),
        }
    }
}

#[test]
fn a_message_in_cbor_has_its_numbers_in_typed_arrays() {
    let (_runtime, mut socket) = paused();
    subscribe(&mut socket, "joint_states", "cbor");
    let frame = binary(&mut socket);
    assert_eq!(frame.get("op").text(), "publish");
    assert_eq!(frame.get("topic").text(), "joint_states");
    let msg = frame.get("msg");
    assert_eq!(msg.get("position"), &Cbor::Floats(vec![0.0, 0.0]));
    assert_eq!(msg.get("header").get("stamp").get("sec"), &Cbor::Integer(0));
    assert_eq!(msg.get("header").get("frame_id").text(), "world");
    let names = ["joint1", "joint2"].map(|name| Cbor::Text(name.to_owned()));
    assert_eq!(msg.get("name"), &Cbor::Array(names.to_vec()));
}

#[test]
fn messages_of_clients_go_as_cbor_whatever_is_in_them() {
    let runtime = Runtime::start();
    let (mut talker, mut listener) = (Socket::open(runtime.address), Socket::open(runtime.address));
    subscribe(&mut listener, "/chat", "cbor");
    listener.settle();
    talker.send(&json!({"op": "advertise", "topic": "/chat"}));
    talker.send_text(
        r#"{"op":"publish","topic":"/chat","msg":{"a":[1,-2,300,70000,5000000000,1.5],"b":{"c":null,"d":true},"e":NaN}}"#,
    );
    let frame = binary(&mut listener);
    let numbers = [1, -2, 300, 70_000, 5_000_000_000].map(Cbor::Integer);
    let mut numbers = numbers.to_vec();
    numbers.push(Cbor::Float(1.5));
    assert_eq!(frame.get("msg").get("a"), &Cbor::Array(numbers));
    assert_eq!(frame.get("msg").get("b").get("c"), &Cbor::Simple(22));
    assert_eq!(frame.get("msg").get("b").get("d"), &Cbor::Simple(21));
    assert_eq!(frame.get("msg").get("e"), &Cbor::Simple(22));
}
