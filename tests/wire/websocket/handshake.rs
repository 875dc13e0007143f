//! The handshake: the origins from which it is taken, the form that it must have, and its answer.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Stdio;

use crate::common::{Logged, PATIENCE, Runtime, SET_GRAVITY, program};
use crate::web_client::{Answer, exchange, handshake, rest, try_handshake};

#[test]
fn a_handshake_needs_no_origin_or_our_own_or_one_of_this_machine() {
    let runtime = Runtime::start();
    let (address, port) = (runtime.address, runtime.address.port());
    assert_eq!(try_handshake(address, "/", &handshake(address)).0, 101);
    for origin in [
        format!("http://{address}"),
        format!("HTTP://{address}"),
        format!("http://localhost:{port}"),
        "http://localhost:3000".to_owned(),
        "http://localhost".to_owned(),
        "http://127.0.0.1:8080".to_owned(),
        "http://[::1]:5173".to_owned(),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, 101, "{origin}");
    }
}

#[test]
fn a_foreign_origin_is_a_403_that_names_the_option() {
    let runtime = Runtime::start();
    let address = runtime.address;
    for origin in [
        "https://evil.example",
        "http://evil.example",
        "http://localhost.evil.example",
        "http://127.0.0.1.evil.example:80",
        "https://localhost",
        "https://127.0.0.1:8080",
        "null",
        "file://",
        "",
        "http://",
        "http://localhost:99999",
        "http://user@localhost",
        "chrome-extension://abcdef",
        "localhost",
        "http://0.0.0.0:80",
        "http://localhost\r\nOrigin: http://localhost",
        // Other ways to write this machine: a browser never sends them as they are here.
        "http://localhost.",
        "http://127.1",
        "http://2130706433",
        "http://0177.0.0.1",
        "http://[::ffff:127.0.0.1]",
        "http://[::1%25lo]",
        "http://l\u{43e}calhost",
        "http://%6cocalhost",
        "http://localhost,evil.example",
        "http://evil.example@localhost",
        "http://localhost/",
        "http://localhost:3000/..",
        "http://localhost http://evil.example",
        "http:localhost",
        "ws://localhost",
        "http://localhost?x",
        "undefined",
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        let (status, body) = try_handshake(address, "/", &headers);
        assert_eq!(status, 403, "{origin}");
        assert!(body.contains("--allow-origin"), "{body}");
    }
    // To the browser, a page whose name was pointed here is of the same origin: `Origin` and `Host` agree.
    let port = address.port();
    for name in [
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.nip.example",
        "localhost,evil.example",
    ] {
        let headers = handshake(address)
            .replace(&format!("Host: {address}"), &format!("Host: {name}:{port}"));
        let headers = format!("{headers}Origin: http://{name}:{port}\r\n");
        let (status, body) = try_handshake(address, "/", &headers);
        assert_eq!(status, 403, "{name}");
        assert!(body.contains("--allow-host"), "{body}");
    }
}

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
fn an_allowed_origin_may_open_a_websocket() {
    let runtime = Runtime::with(&["--allow-origin", "https://Class.example,null"]);
    let address = runtime.address;
    for (origin, status) in [
        ("https://class.example", 101),
        ("null", 101),
        ("http://class.example", 403),
        ("https://class.example:8443", 403),
        ("file://", 403),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, status, "{origin}");
    }
}

/// A program has no origin, and could use the raw port as well: the switch is about pages.
#[test]
fn with_a_strict_origin_only_our_own_page_and_those_named_may() {
    let arguments = ["--strict-origin", "--allow-origin", "https://class.example"];
    let runtime = Runtime::with(&arguments);
    let (address, port) = (runtime.address, runtime.address.port());
    for (origin, status) in [
        (format!("http://{address}"), 101),
        ("https://class.example".to_owned(), 101),
        ("http://localhost:3000".to_owned(), 403),
        // Ours by another name than the one that was asked for.
        (format!("http://localhost:{port}"), 403),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, status, "{origin}");
    }
    assert_eq!(try_handshake(address, "/", &handshake(address)).0, 101);
}

#[test]
fn a_handshake_that_is_not_as_it_has_to_be_is_refused() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let good = handshake(address);
    for (from, to, status, word) in [
        ("Version: 13", "Version: 8", 426, "version 13"),
        ("Sec-WebSocket-Version: 13\r\n", "", 426, "version 13"),
        (
            "dGhlIHNhbXBsZSBub25jZQ==",
            "short",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "dGhlIHNhbXBsZSBub25jZQ==",
            "dGhlIHNhbXBsZSBub25jZQ!!",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
            "",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "Connection: Upgrade",
            "Connection: close",
            400,
            "Connection: upgrade",
        ),
        (
            "Upgrade: websocket",
            "Upgrade: h2c",
            400,
            "Upgrade: websocket",
        ),
    ] {
        let (got, body) = try_handshake(address, "/", &good.replace(from, to));
        assert_eq!(got, status, "{to}");
        assert!(body.contains(word), "{body}");
    }
    assert_eq!(try_handshake(address, "/other", &good).0, 404);
    let old = format!("GET / HTTP/1.0\r\n{good}\r\n");
    assert_eq!(
        Answer::parse(&exchange(address, old.as_bytes())).status,
        400
    );
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

/// A body is not a way past the check of the host and the origin, nor is a request behind one that was refused.
#[test]
fn a_handshake_hidden_in_a_request_opens_nothing() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let inner = format!("GET / HTTP/1.1\r\n{}\r\n", handshake(address));
    let frame = SET_GRAVITY.trim_end();
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
    runtime.assert_nothing_was_executed();
}
