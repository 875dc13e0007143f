//! Closes: for messages that are too long, for frames against the protocol, at the client's wish, at the runtime's end;
//! and a client that goes without one.

use crate::common::{PATIENCE, Runtime};
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

/// Frames as no client of the protocol sends them: first byte (final, reserved bits, opcode), second (masked, length), rest.
#[test]
fn frames_against_the_protocol_close_with_1002() {
    let runtime = Runtime::start();
    for bytes in [
        &b"\x81\x02{}"[..],                         // not masked
        &b"\xc1\x82\0\0\0\0{}"[..],                 // a reserved bit
        &b"\x83\x82\0\0\0\0{}"[..],                 // a reserved opcode
        &b"\x80\x82\0\0\0\0{}"[..],                 // goes on with nothing
        &b"\x09\x80\0\0\0\0"[..],                   // a ping in fragments
        &b"\x89\xfe\x00\x7e\0\0\0\0"[..],           // a ping of 126 bytes
        &b"\x01\x81\0\0\0\0{\x81\x81\0\0\0\0}"[..], // a second message within a first
    ] {
        let mut socket = Socket::open(runtime.address);
        socket.send_bytes(bytes);
        if bytes.starts_with(b"\x89\xfe") {
            socket.send_bytes(&[0; 126]);
        }
        assert_eq!(socket.close_code(), Some(1002), "{bytes:x?}");
        assert!(socket.is_closed());
    }
    Socket::open(runtime.address).settle();
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

#[test]
fn what_a_client_registered_goes_with_it_also_without_a_close() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.settle();
    drop(socket);
    let mut client = runtime.connect();
    let deadline = std::time::Instant::now() + PATIENCE;
    loop {
        let args = json!({"op": "call_service", "service": "/mine", "timeout": 0.05});
        client.send(&args);
        let response = client.receive();
        if response["status"] == "no provider for service /mine" {
            break;
        }
        assert!(std::time::Instant::now() < deadline, "{response}");
    }
}

#[cfg(unix)]
#[test]
fn the_runtimes_end_closes_with_1001_and_in_time() {
    let mut runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.settle();
    let pid = runtime.pid().to_string();
    let killed = std::process::Command::new("kill")
        .args(["-TERM", &pid])
        .status();
    assert!(killed.unwrap().success());
    assert_eq!(socket.close_code(), Some(1001));
    let status = runtime.end().0;
    assert_eq!(status.code(), Some(0));
}
