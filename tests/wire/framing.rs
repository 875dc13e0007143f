//! Frames, other bytes, and that a malformed frame costs nobody anything else.
//!
//! **Invariant:** whatever is sent, the connection works afterwards, and nothing inside a malformed frame is executed.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

/// A call that must not be executed where it stands inside a malformed frame.
const SET_GRAVITY: &str =
    r#"{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":1}}"#;
const MAX_FRAME: usize = 4 * 1024 * 1024;

fn gravity(client: &mut Client) -> Value {
    client.ask("/arm_sim/set_params", json!({}))["gravity"].clone()
}

/// Sends what must be answered by `errors` error statuses and nothing else; gives their texts.
fn malformed(bytes: &[u8], errors: usize) -> Vec<String> {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(bytes);
    let texts = (0..errors)
        .map(|_| {
            let status = client.receive();
            assert_eq!(status["op"], "status", "{status}");
            assert_eq!(status["level"], "error", "{status}");
            status["msg"].as_str().expect("a text").to_owned()
        })
        .collect();
    assert_eq!(gravity(&mut client), 9.81, "something inside was executed");
    assert!(client.kept.is_empty(), "answered more: {:?}", client.kept);
    texts
}

/// A call of exactly `length` bytes: unknown members are ignored.
fn call_of_length(length: usize, id: &str) -> Vec<u8> {
    let frame = |pad: &str| {
        json!({"op": "call_service", "service": "/arm_sim/set_params", "id": id, "pad": pad})
            .to_string()
    };
    let bytes = frame(&"x".repeat(length - frame("").len())).into_bytes();
    assert_eq!(bytes.len(), length);
    bytes
}

#[test]
fn a_frame_may_come_one_byte_at_a_time() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for byte in format!("{SET_GRAVITY}\n").as_bytes() {
        client.send_bytes(&[*byte]);
    }
    assert_eq!(client.receive()["values"]["gravity"], 1.0);
}

#[test]
fn every_frame_of_the_runtime_is_one_line() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "subscribe", "topic": "/joint_states"}));
    client.send(&json!({"op": "call_service", "service": "/no\nsuch", "id": "a\nb"}));
    for _ in 0..5 {
        let line = client.receive_text();
        assert!(serde_json::from_str::<Value>(&line).is_ok(), "{line:?}");
    }
}

#[test]
fn a_line_that_opens_with_anything_else_is_one_malformed_frame() {
    for opening in [
        "garbage ", "[", "\"", "42 ", "}", "]", "null,", "/", "\u{feff}",
    ] {
        malformed(
            format!("{opening}{SET_GRAVITY}{SET_GRAVITY}\n").as_bytes(),
            1,
        );
    }
}

#[test]
fn a_longer_frame_gets_one_error_and_is_skipped_to_its_end() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for surplus in [1, 10_000_000] {
        client.send_bytes(&call_of_length(MAX_FRAME + surplus, "too long"));
        // No newline: it would have ended where its braces balance.
        client.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "id": "next"}));
        let status = client.receive();
        assert_eq!(
            (&status["op"], &status["level"]),
            (&json!("status"), &json!("error"))
        );
        assert!(
            status["msg"].as_str().unwrap().contains("4194304"),
            "{status}"
        );
        assert_eq!(client.receive()["id"], "next");
    }
    // The same for a line that is no object, and one whose newline comes first.
    client.send_bytes(&[b'x'; 5_000_000]);
    client.send_bytes(format!("{SET_GRAVITY}\n").as_bytes());
    assert_eq!(client.receive()["level"], "error");
    let mut cut = call_of_length(MAX_FRAME + 9, "too long");
    cut.truncate(MAX_FRAME + 5);
    client.send_bytes(&cut);
    client.send_bytes(b"\n");
    assert_eq!(client.receive()["level"], "error");
    assert_eq!(gravity(&mut client), 9.81);
    assert!(client.kept.is_empty(), "{:?}", client.kept);
}

#[test]
fn payloads_pass_untouched_but_for_numbers_that_are_not_finite() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "advertise", "topic": "/t"}));
    client.subscribe("/t");
    let sent = r#"{ "a" : 1.000000000000000000000000001 ,"b":[NaN,1E5,-Infinity, 1e-400 ], "b":Infinity,"NaN":"NaN 1e999","c":123456789012345678901234567890,"d":"\u00e9\/é","e":-1e999}"#;
    let strict = r#"{ "a" : 1.000000000000000000000000001 ,"b":[null,1E5,null, 1e-400 ], "b":null,"NaN":"NaN 1e999","c":123456789012345678901234567890,"d":"\u00e9\/é","e":null}"#;
    client
        .send_bytes(format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{sent}}}\n").as_bytes());
    assert_eq!(
        client.receive_text(),
        format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{strict}}}")
    );
}

#[test]
fn arguments_and_values_of_forwarded_calls_pass_in_the_same_way() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "advertise_service", "service": "/s"}));
    client.status();
    client.send_bytes(
        b"{\"op\":\"call_service\",\"service\":\"/s\",\"id\":1,\"args\":{\"x\": NaN, \"y\":1E2}}\n",
    );
    let line = client.receive_text();
    assert!(line.contains("{\"x\": null, \"y\":1E2}"), "{line}");
    let call: Value = serde_json::from_str(&line).unwrap();
    client.send_bytes(
        format!(
            "{{\"op\":\"service_response\",\"service\":\"/s\",\"id\":{},\"result\":true,\"values\":{{\"z\": -1e999, \"w\":1.50}}}}\n",
            call["id"]
        )
        .as_bytes(),
    );
    let line = client.receive_text();
    assert!(line.contains("{\"z\": null, \"w\":1.50}"), "{line}");
}
