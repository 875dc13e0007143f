//! A stream that opens like HTTP, TLS or BSON is never read as JSON.
//!
//! **Invariant:** a foreign client gets one line and the end, however its bytes are cut up, and moves nothing.

use std::net::Shutdown;

use crate::common::{Client, Runtime};
use serde_json::json;

const SET_GRAVITY: &str = "\r\n\r\n{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"args\":{\"gravity\":1}}\n";

/// How foreign clients open, and a word that their line of explanation must have.
fn openings() -> Vec<(Vec<u8>, &'static str)> {
    let methods = [
        #[cfg(not(feature = "web"))]
        "GET / HTTP/1.1",
        #[cfg(not(feature = "web"))]
        "HEAD / HTTP/1.1",
        "POST /x HTTP/1.1",
        "PUT / HTTP/1.1",
        "DELETE / HTTP/1.1",
        "CONNECT a:1 HTTP/1.1",
        "OPTIONS * HTTP/1.1",
        "TRACE / HTTP/1.1",
        "PATCH / HTTP/1.1",
        "PRI * HTTP/2.0",
    ];
    let mut all: Vec<(Vec<u8>, &str)> = methods
        .iter()
        .map(|line| (line.as_bytes().to_vec(), "HTTP"))
        .collect();
    all.push((
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(),
        "TLS",
    ));
    all.push((
        b"\x2e\x00\x00\x00\x02op\x00\x0a\x00\x00\x00".to_vec(),
        "BSON",
    ));
    all.push((b"\x00\x00\x01\x00".to_vec(), "BSON"));
    all.push((b"{\"\"\x00".to_vec(), "BSON"));
    all
}

/// The one line that a foreign client gets before the end.
fn explanation(client: &mut Client) -> String {
    let status = client.receive();
    assert_eq!(status["op"], "status", "{status}");
    assert_eq!(status["level"], "error", "{status}");
    let line = status["msg"].as_str().expect("a text").to_owned();
    let mut rest = Vec::new();
    std::io::Read::read_to_end(&mut client.stream(), &mut rest).expect("an orderly end");
    assert!(rest.is_empty(), "more than one line: {rest:?}");
    line
}

/// Lets the runtime read what has been sent: another client comes behind it, and is answered.
fn let_read(runtime: &Runtime) {
    runtime.connect().settle();
}

fn assert_nothing_was_executed(runtime: &Runtime) {
    let parameters = runtime.connect().ask("/arm_sim/set_params", json!({}));
    assert_eq!(parameters["gravity"], 9.81);
}

#[test]
fn a_foreign_opening_gets_one_line_and_is_closed() {
    let runtime = Runtime::start();
    for (opening, word) in openings() {
        let mut client = runtime.connect();
        let mut bytes = opening;
        bytes.extend_from_slice(SET_GRAVITY.as_bytes());
        client.send_bytes(&bytes);
        let line = explanation(&mut client);
        assert!(line.contains(word), "{line}");
    }
    assert_nothing_was_executed(&runtime);
}

#[test]
fn a_foreign_opening_is_known_also_byte_by_byte() {
    let runtime = Runtime::start();
    for (opening, word) in openings() {
        let mut client = runtime.connect();
        for byte in opening.iter().chain(SET_GRAVITY.as_bytes()) {
            // After the opening the other side may have closed already: then a write may fail.
            let _ = std::io::Write::write(&mut client.stream(), &[*byte]);
        }
        let line = explanation(&mut client);
        assert!(line.contains(word), "{line}");
    }
    assert_nothing_was_executed(&runtime);
}

#[test]
fn a_posted_body_of_a_megabyte_is_swallowed_and_the_line_can_still_be_read() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut request = b"POST / HTTP/1.1\r\nContent-Length: 1000000\r\n".to_vec();
    for _ in 0..10_000 {
        request.extend_from_slice(SET_GRAVITY.as_bytes());
    }
    client.send_bytes(&request);
    assert!(explanation(&mut client).contains("HTTP"));
    assert_nothing_was_executed(&runtime);
}

#[test]
fn a_prefix_that_may_become_a_request_waits_for_more() {
    let runtime = Runtime::start();
    for (prefix, rest) in [
        ("G", "ETTING\n"),
        ("POST", "\n"),
        ("OPTIONS", "\n"),
        ("\u{16}", "\u{4}ab\n"),
    ] {
        let mut client = runtime.connect();
        client.send_bytes(prefix.as_bytes());
        let_read(&runtime);
        // Had it been taken for a request, the first line would say so, and the end would follow.
        client.send_bytes(rest.as_bytes());
        let why = client.receive()["msg"].to_string();
        assert!(!why.contains("HTTP") && !why.contains("TLS"), "{why}");
        client.settle();
    }
    let mut client = runtime.connect();
    client.send_bytes(b"PO");
    let_read(&runtime);
    client.send_bytes(b"ST ");
    assert!(explanation(&mut client).contains("HTTP"));
}

#[test]
fn the_shortest_frame_is_answered_though_it_has_fewer_than_four_bytes() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(b"{}\n");
    assert_eq!(client.receive()["level"], "error");
    client.settle();
}

#[test]
fn a_client_that_says_nothing_is_told_nothing() {
    let runtime = Runtime::start();
    let client = runtime.connect();
    client.stream().shutdown(Shutdown::Write).unwrap();
    let mut rest = Vec::new();
    std::io::Read::read_to_end(&mut client.stream(), &mut rest).unwrap();
    assert!(rest.is_empty());
}
