//! Requests as bytes on a real socket: heads that are too long, slow or cut.

use std::io::Write;
use std::net::{Shutdown, TcpStream};

use crate::common::{PATIENCE, Runtime};
use crate::web_client::{Answer, exchange, get, rest};
use pendularm::web::head::{MAX_HEAD, MAX_HEADERS};

#[test]
fn a_huge_head_is_refused_and_what_follows_is_swallowed() {
    let runtime = Runtime::start();
    let start = format!("GET / HTTP/1.1\r\nHost: {}\r\n", runtime.address);
    let long = format!("{start}X: {}\r\n\r\n", "x".repeat(500_000));
    let many = format!("{start}{}\r\n", "X: y\r\n".repeat(1000));
    let path = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(20_000));
    for head in [long, many, path] {
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, 431);
        assert!(answer.text().contains("16384 bytes"));
    }
    // Just within the limit.
    let room = MAX_HEAD - start.len() - "X: \r\n\r\n".len();
    for (length, status) in [(room, 200), (room + 1, 431)] {
        let head = format!("{start}X: {}\r\n\r\n", "x".repeat(length));
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, status);
    }
    for (others, status) in [(MAX_HEADERS - 1, 200), (MAX_HEADERS, 431)] {
        let head = format!("{start}{}\r\n", "X: y\r\n".repeat(others));
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, status, "{others}");
    }
}

#[test]
fn a_request_that_comes_byte_by_byte_is_answered() {
    let runtime = Runtime::start();
    let mut stream = TcpStream::connect(runtime.address).unwrap();
    stream.set_nodelay(true).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    for byte in format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", runtime.address).as_bytes() {
        stream.write_all(&[*byte]).unwrap();
    }
    stream.shutdown(Shutdown::Write).unwrap();
    assert_eq!(Answer::parse(&rest(&mut stream)).status, 200);
}

#[test]
fn a_client_that_leaves_within_its_head_costs_nothing() {
    let runtime = Runtime::start();
    for _ in 0..100 {
        let mut stream = TcpStream::connect(runtime.address).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nHost").unwrap();
        stream.shutdown(Shutdown::Write).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        assert!(rest(&mut stream).is_empty());
    }
    assert_eq!(get(runtime.address, "/").status, 200);
}

/// Health checks ask so.
#[test]
fn head_has_the_head_of_the_answer_to_get_and_no_body() {
    let runtime = Runtime::start();
    let address = runtime.address;
    for path in ["/", "/main.js", "/report/", "/nothing", "/report"] {
        let ask = |method: &str| {
            let request = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\n\r\n");
            String::from_utf8_lossy(&exchange(address, request.as_bytes())).into_owned()
        };
        let (got, head) = (ask("GET"), ask("HEAD"));
        assert!(head.ends_with("\r\n\r\n"), "{path}: {head}");
        assert_eq!(
            Some(head.trim_end()),
            got.split("\r\n\r\n").next(),
            "{path}"
        );
    }
}
