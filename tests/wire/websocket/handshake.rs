//! The handshake: its answer, and the log. `tests/actors/exchanges/http.txt` has the origins that are admitted.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Stdio;

use crate::common::{Logged, PATIENCE, Runtime, program};
use crate::web_client::{Answer, handshake, rest, try_handshake};

/// A browser shows nobody the answer to a handshake.
#[test]
fn the_log_names_the_option_for_a_foreign_origin() {
    let mut runtime = Logged::start(program(), Stdio::null());
    let headers = handshake(runtime.address) + "Origin: https://class.example\r\n";
    try_handshake(runtime.address, "/", &headers);
    let line = runtime.await_line("--allow-origin");
    assert!(line.contains("WARN"), "{line}");
    assert!(line.contains("https://class.example"), "{line}");
}

#[test]
fn the_handshake_is_answered_as_the_rfc_has_it_and_frames_may_follow_at_once() {
    let runtime = Runtime::start();
    let mut stream = TcpStream::connect(runtime.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    // Compression would let a page learn what else is in the stream, and a small message be a large one.
    let offers = "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\
                  Sec-WebSocket-Protocol: rosbridge_v2, json\r\n";
    let head = format!(
        "GET / HTTP/1.1\r\n{}{offers}\r\n",
        handshake(runtime.address)
    );
    let mut bytes = head.into_bytes();
    let frame = br#"{"op":"call_service","service":"/arm_sim/pause","id":1}"#;
    bytes.extend_from_slice(&[0x81, 0x80 | u8::try_from(frame.len()).unwrap(), 0, 0, 0, 0]);
    bytes.extend_from_slice(frame);
    stream.write_all(&bytes).unwrap();
    // The frame of the answer is short, so its end shows that it is there.
    let mut answered = Vec::new();
    while !answered.ends_with(b"\"status\":\"\"}") {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        answered.push(byte[0]);
    }
    // A close without a reason.
    stream.write_all(b"\x88\x80\0\0\0\0").unwrap();
    answered.extend(rest(&mut stream));
    let answer = Answer::parse(&answered);
    // The key of RFC 6455, section 1.3.
    assert_eq!(answer.status, 101);
    assert_eq!(
        answer.header("sec-websocket-accept"),
        Some("s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")
    );
    assert_eq!(answer.header("sec-websocket-extensions"), None);
    assert_eq!(answer.header("sec-websocket-protocol"), None);
    let text = String::from_utf8_lossy(&answer.body);
    assert!(
        text.contains("\"id\":1,\"values\":{\"data\":false}"),
        "{text}"
    );
    assert!(answer.body.ends_with(b"\x88\x00"));
}
