//! Closes: for messages that are too long, for frames against the protocol, at the client's wish.

use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::websocket::{LAST, opcode};
use serde_json::json;

#[test]
fn a_message_of_4_mib_is_taken_and_a_longer_one_closes_with_1009() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = |length: usize| {
        let shell = r#"{"op":"call_service","service":"/arm_sim/pause","id":1,"pad":""}"#;
        shell.replace("\"\"", &format!("\"{}\"", "x".repeat(length - shell.len())))
    };
    let limit = 4 * 1024 * 1024;
    socket.send_text(&frame(limit));
    assert_eq!(socket.receive()["id"], 1);
    socket.send_text(&frame(limit + 1));
    assert_eq!(socket.close_code(), Some(1009));
    let mut other = Socket::open(runtime.address);
    other.send_frame(opcode::TEXT, &vec![b' '; limit]);
    other.send_frame(LAST | opcode::CONTINUATION, b"  ");
    assert_eq!(other.close_code(), Some(1009));
}

#[test]
fn text_that_is_not_utf_8_closes_with_1007_and_binary_is_a_malformed_frame() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "set_level", "level": "error"}));
    socket.send_frame(LAST | opcode::BINARY, b"{\"op\":\"\xff\"}");
    assert_eq!(socket.receive()["level"], "error");
    socket.send_frame(LAST | opcode::TEXT, b"{\"op\":\"\xff\"}");
    assert_eq!(socket.close_code(), Some(1007));
}

#[test]
fn a_close_is_answered_with_the_same_code_and_the_stream_ends() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.settle();
    socket.close(1000, "done");
    assert_eq!(socket.close_code(), Some(1000));
    assert!(socket.is_closed());
}

/// Frames as no client of the protocol sends them, and the code with which each is answered. Of the lengths, nothing may
/// be set aside for them.
const AGAINST_THE_PROTOCOL: [(&[u8], u16); 23] = [
    (b"\x81\x02{}", 1002),                         // not masked
    (b"\xc1\x82\0\0\0\0{}", 1002),                 // the first reserved bit
    (b"\xa1\x82\0\0\0\0{}", 1002),                 // the second
    (b"\x91\x82\0\0\0\0{}", 1002),                 // the third
    (b"\x83\x82\0\0\0\0{}", 1002),                 // a reserved kind
    (b"\x8b\x80\0\0\0\0", 1002),                   // a reserved control frame
    (b"\x80\x82\0\0\0\0{}", 1002),                 // continues nothing
    (b"\x01\x81\0\0\0\0{\x81\x81\0\0\0\0}", 1002), // a second message within a first
    (b"\x09\x80\0\0\0\0", 1002),                   // a ping in fragments
    (b"\x08\x80\0\0\0\0", 1002),                   // a close in fragments
    (b"\x89\xfe\x00\x7e\0\0\0\0", 1002),           // a ping of 126 bytes
    (b"\x88\xfe\x00\x7e\0\0\0\0", 1002),           // a close of 126 bytes
    (b"\x81\xff\x3f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 1009),
    (b"\x82\xff\0\0\0\0\x00\x40\x00\x01\0\0\0\0", 1009), // 4 MiB and a byte
    (b"\x88\x81\0\0\0\0\x03", 1002),                     // half a close code
    (b"\x88\x82\0\0\0\0\x00\x00", 1002),                 // 0
    (b"\x88\x82\0\0\0\0\x03\xe7", 1002),                 // 999
    (b"\x88\x82\0\0\0\0\x03\xec", 1002),                 // 1004
    (b"\x88\x82\0\0\0\0\x03\xed", 1002),                 // 1005: never sent
    (b"\x88\x82\0\0\0\0\x03\xee", 1002),                 // 1006: never sent
    (b"\x88\x82\0\0\0\0\xff\xff", 1002),                 // 65535
    (b"\x88\x84\0\0\0\0\x03\xe8\xff\xfe", 1007),         // a reason that is no text
    (b"\x88\x85\0\0\0\0\x03\xe8\xed\xa0\x80", 1007),     // half a surrogate pair
];

#[test]
fn frames_against_the_protocol_close_their_connection_and_cost_nobody_else() {
    let runtime = Runtime::start();
    for (bytes, expected) in AGAINST_THE_PROTOCOL {
        let mut socket = Socket::open(runtime.address);
        socket.send_bytes(bytes);
        if bytes[1] == 0xfe {
            socket.send_bytes(&[0; 126]);
        }
        let code = socket.close_code();
        // A close that cannot be read is a fault of either kind.
        let is_close = bytes[0] == 0x88 && code == Some(1002) || code == Some(1007);
        assert!(
            code == Some(expected) || bytes[0] == 0x88 && is_close,
            "{code:?} {bytes:x?}"
        );
        assert!(socket.is_closed());
    }
    Socket::open(runtime.address).settle();
}
