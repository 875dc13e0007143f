//! WebSocket clients that mean harm: frames, closes and handshakes as no client of the protocol sends them.
//!
//! Others of that kind are in `websocket/closing.rs` and `websocket/handshake.rs`.
//!
//! **Invariant:** whoever breaks a rule is told so by a close frame and closed, and the next client is served.

#![cfg(feature = "web")]
use std::io::Write;
use std::net::TcpStream;

use crate::common::{PATIENCE, Runtime};
use crate::web_client::{Answer, Socket, exchange, handshake, rest};
use pendularm_client::websocket::{LAST, opcode};
use serde_json::json;

const SET_GRAVITY: &str =
    r#"{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":1}}"#;

/// A client's close is as little to be trusted as what it sends before. Payloads of a close frame, each against a
/// rule of RFC 6455, section 5.5.1 or 7.4.
#[test]
fn a_close_frame_against_the_protocol_is_answered_as_such_and_costs_nobody_else() {
    let runtime = Runtime::start();
    for payload in [
        &b"\x03"[..],                 // half a code
        &b"\x00\x00"[..],             // 0
        &b"\x03\xe7"[..],             // 999
        &b"\x03\xec"[..],             // 1004
        &b"\x03\xed"[..],             // 1005: never sent
        &b"\x03\xee"[..],             // 1006: never sent
        &b"\xff\xff"[..],             // 65535
        &b"\x03\xe8\xff\xfe"[..],     // a reason that is no text
        &b"\x03\xe8\xed\xa0\x80"[..], // half a surrogate pair
    ] {
        let mut socket = Socket::open(runtime.address);
        socket.send_frame(LAST | opcode::CLOSE, payload);
        let code = socket.close_code();
        let expected = [Some(1002), Some(1007)];
        assert!(expected.contains(&code), "{code:?} for {payload:x?}");
        assert!(socket.is_closed());
    }
    Socket::open(runtime.address).settle();
}

/// A frame's head alone, as no client of the protocol sends it; of the lengths, nothing may be set aside for them.
#[test]
fn a_frame_whose_head_is_against_the_protocol_is_refused_by_that_alone() {
    let runtime = Runtime::start();
    for (head, expected) in [
        (&b"\xa1\x82\0\0\0\0{}"[..], 1002), // the second reserved bit
        (&b"\x91\x82\0\0\0\0{}"[..], 1002), // the third
        (&b"\x8b\x80\0\0\0\0"[..], 1002),   // a reserved control frame
        (&b"\x08\x80\0\0\0\0"[..], 1002),   // a close in fragments
        (&b"\x88\xfe\x00\x7e\0\0\0\0"[..], 1002), // a close of 126 bytes
        (
            &b"\x81\xff\x3f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0"[..],
            1009,
        ),
        (&b"\x82\xff\0\0\0\0\x00\x40\x00\x01\0\0\0\0"[..], 1009), // 4 MiB and a byte
    ] {
        let mut socket = Socket::open(runtime.address);
        socket.send_bytes(head);
        if head.starts_with(b"\x88\xfe") {
            socket.send_bytes(&[0; 126]);
        }
        assert_eq!(socket.close_code(), Some(expected), "{head:x?}");
    }
    Socket::open(runtime.address).settle();
}

/// Compression would let a page learn what else is in the stream, and a small message be a large one.
#[test]
fn no_extension_and_no_subprotocol_is_agreed_to() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let offers = "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\
                  Sec-WebSocket-Protocol: rosbridge_v2, json\r\n";
    let request = format!("GET / HTTP/1.1\r\n{}{offers}\r\n\u{1}", handshake(address));
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    // The byte behind the head begins a frame that is not masked, so that the stream ends.
    stream.write_all(request.as_bytes()).unwrap();
    stream.write_all(b"\x02{}").unwrap();
    let answer = Answer::parse(&rest(&mut stream));
    assert_eq!(answer.status, 101);
    assert_eq!(answer.header("sec-websocket-extensions"), None);
    assert_eq!(answer.header("sec-websocket-protocol"), None);
}

/// Each ping would be answered, and nobody reads the answers.
#[test]
fn pings_without_end_are_answered_as_far_as_they_are_read() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut ping = vec![0x89, 0x80 | 125, 0, 0, 0, 0];
    ping.extend_from_slice(&[b'x'; 125]);
    let before = runtime.peak_memory();
    // More than any two sockets hold.
    for _ in 0..400 {
        socket.send_bytes(&ping.repeat(1000));
    }
    let grown = runtime.peak_memory().saturating_sub(before);
    assert!(
        grown < 8_000_000,
        "{grown} bytes for pongs that are not read"
    );
    let response = socket.call("/arm_sim/set_params", json!({}));
    assert_eq!(response["result"], true);
}

/// A body is not a way past the check of the host and the origin, nor is a request behind one that was refused.
#[test]
fn a_handshake_hidden_in_a_request_opens_nothing() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let inner = format!("GET / HTTP/1.1\r\n{}\r\n", handshake(address));
    let frame = SET_GRAVITY;
    let mut text = vec![0x81, 0x80 | u8::try_from(frame.len()).unwrap(), 0, 0, 0, 0];
    text.extend_from_slice(frame.as_bytes());
    for outer in [
        format!(
            "GET / HTTP/1.1\r\nHost: {address}\r\nContent-Length: {}\r\n\r\n",
            inner.len()
        ),
        format!(
            "GET / HTTP/1.1\r\nHost: {address}\r\nTransfer-Encoding: chunked\r\n\r\n{:x}\r\n",
            inner.len()
        ),
        "GET / HTTP/1.1\r\nHost: evil.example\r\nX: \r\n\r\n".to_owned(),
    ] {
        let mut bytes = (outer + &inner).into_bytes();
        bytes.extend_from_slice(&text);
        let answer = Answer::parse(&exchange(address, &bytes));
        assert_ne!(answer.status, 101);
    }
    let parameters = runtime.connect().ask("/arm_sim/set_params", json!({}));
    assert_eq!(parameters["gravity"], 9.81);
}

/// Over raw TCP objects may follow one another without a line between them; a message holds one, or nothing of it is done.
#[test]
fn a_message_with_two_objects_executes_neither() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "set_level", "level": "info"}));
    let gravity = SET_GRAVITY.trim_end();
    let subscribe = "{\"op\":\"subscribe\",\"topic\":\"/clock\"}";
    let message = "{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}";
    for (first, second) in [
        (gravity, gravity),
        (gravity, subscribe),
        (subscribe, gravity),
        (message, gravity),
        (gravity, "x"),
        (gravity, "}"),
        (gravity, "\0"),
    ] {
        for between in ["", " ", "\n", "\r\n", ","] {
            socket.send_text(&format!("{first}{between}{second}"));
            let status = socket.receive();
            assert_eq!(status["level"], "error", "{status}");
            assert!(
                status["msg"].as_str().unwrap().contains("one JSON object"),
                "{status}"
            );
        }
    }
    // White space behind the object is none.
    for end in ["", "\n", " \r\n\t"] {
        socket.send_text(&format!(
            "{{\"op\":\"call_service\",\"service\":\"/none\",\"id\":5}}{end}"
        ));
        assert_eq!(socket.receive()["id"], 5);
    }
    socket.settle();
    runtime.assert_nothing_was_executed();
}
