//! Streams that open like HTTP, TLS or BSON, and frames on a real socket: cut at any byte, and written as one line each.
//!
//! **Invariant:** a foreign client gets one line and the end, and nothing that it sends is executed.

use crate::common::{Client, Runtime, SET_GRAVITY};
use serde_json::{Value, json};

/// The one line that a foreign client gets before the end.
fn explanation(client: &mut Client) -> String {
    let status = client.receive();
    assert_eq!(status["level"], "error", "{status}");
    let mut rest = Vec::new();
    std::io::Read::read_to_end(&mut client.stream(), &mut rest).expect("an orderly end");
    assert!(rest.is_empty(), "more than one line: {rest:?}");
    status["msg"].as_str().expect("a text").to_owned()
}

#[test]
fn a_foreign_opening_gets_one_line_and_is_closed_also_byte_by_byte() {
    let runtime = Runtime::start();
    let tls = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03";
    let bson = b"\x2e\x00\x00\x00\x02op\x00\x0a\x00\x00\x00";
    for (opening, word) in [
        (&b"POST /x HTTP/1.1"[..], "HTTP"),
        (b"PRI * HTTP/2.0", "HTTP"),
        (tls, "TLS"),
        (bson, "BSON"),
    ] {
        let bytes = [opening, b"\r\n\r\n", SET_GRAVITY.as_bytes()].concat();
        let mut client = runtime.connect();
        client.send_bytes(&bytes);
        assert!(explanation(&mut client).contains(word));
        let mut client = runtime.connect();
        for byte in &bytes {
            // After the opening the other side may have closed already: then a write may fail.
            let _ = std::io::Write::write(&mut client.stream(), &[*byte]);
        }
        assert!(explanation(&mut client).contains(word));
    }
    runtime.assert_nothing_was_executed();
}

#[test]
fn a_posted_body_of_a_megabyte_is_swallowed_and_the_line_can_still_be_read() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let request = "POST / HTTP/1.1\r\nContent-Length: 1000000\r\n\r\n".to_owned();
    client.send_bytes((request + &SET_GRAVITY.repeat(10_000)).as_bytes());
    assert!(explanation(&mut client).contains("HTTP"));
    runtime.assert_nothing_was_executed();
}

#[test]
fn frames_come_one_byte_at_a_time_and_each_answer_is_one_line() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for byte in SET_GRAVITY.as_bytes() {
        client.send_bytes(&[*byte]);
    }
    assert_eq!(client.receive()["values"]["gravity"], 1.0);
    client.send(&json!({"op": "subscribe", "topic": "/joint_states"}));
    client.send(&json!({"op": "call_service", "service": "/no\nsuch", "id": "a\nb"}));
    for _ in 0..5 {
        let line = client.receive_text();
        assert!(serde_json::from_str::<Value>(&line).is_ok(), "{line:?}");
    }
}
