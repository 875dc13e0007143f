//! Requests as bytes: heads that are too long, too slow or none, and bodies that nobody executes.

use std::io::Write;
use std::net::{Shutdown, TcpStream};

use crate::common::{PATIENCE, Runtime, SET_GRAVITY};
use crate::web_client::{Answer, exchange, get, request, rest};
use pendularm::web::head::MAX_HEAD;

/// Bytes behind a request are no request, however its length is told: the first answer is the last.
#[test]
fn no_second_request_is_smuggled_behind_the_first() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let second = format!("GET /nothing HTTP/1.1\r\nHost: {address}\r\n\r\n");
    for lengths in [
        "",
        "Connection: keep-alive\r\n",
        "Content-Length: 0\r\n",
        "Content-Length: 5\r\nContent-Length: 0\r\n",
        "Transfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nContent-Length: 4\r\n",
        "Transfer-Encoding: xchunked\r\nContent-Length: -1\r\n",
    ] {
        for body in ["", "0\r\n\r\n"] {
            let request =
                format!("GET / HTTP/1.1\r\nHost: {address}\r\n{lengths}\r\n{body}{second}");
            let bytes = exchange(address, request.as_bytes());
            let answers = String::from_utf8_lossy(&bytes).matches("HTTP/1.1 ").count();
            assert_eq!(
                (answers, Answer::parse(&bytes).status),
                (1, 200),
                "{lengths}"
            );
        }
    }
}

#[test]
fn what_is_no_request_is_a_400_that_says_why() {
    let runtime = Runtime::start();
    for head in [
        "GET /\r\n\r\n",
        "GET / HTTP/1.2\r\n\r\n",
        "GET / HTTP/1.1\r\nHost\r\n\r\n",
        "GET / HTTP/1.1\r\nHo st: a\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: a\x01b\r\n\r\n",
        "GET / HTTP/1.1\r\n Host: folded\r\n\r\n",
        "GET http://127.0.0.1/ HTTP/1.1\r\n\r\n",
        "GET \t HTTP/1.1\r\n\r\n",
    ] {
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, 400, "{head:?}");
        assert!(answer.text().contains("not a well-formed HTTP request"));
    }
}

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
    assert_eq!(Answer::parse(&rest(&mut stream)).status, 200);
}

#[test]
fn lines_may_end_in_a_newline_alone_and_the_version_may_be_1_0() {
    let runtime = Runtime::start();
    let head = format!("GET / HTTP/1.0\nHost: {}\n\n", runtime.address);
    let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
    assert_eq!(answer.status, 200);
}

#[test]
fn json_behind_a_request_is_not_executed_however_it_is_hidden() {
    let runtime = Runtime::start();
    let own = format!("Host: {}\r\n", runtime.address);
    for head in [
        format!("GET / HTTP/1.1\r\n{own}\r\n"),
        format!("GET / HTTP/1.1\r\n{own}Content-Length: 100\r\n\r\n"),
        format!("GET / HTTP/1.1\r\n{own}Transfer-Encoding: chunked\r\n\r\n"),
        "GET / HTTP/1.1\r\n\r\n".to_owned(),
        "GET \r\n".to_owned(),
        "GET /\r\n\r\nGET / HTTP/1.1\r\n\r\n".to_owned(),
    ] {
        // Two line ends: a head that has not ended does so here.
        let bytes = format!("{head}{SET_GRAVITY}\r\n\r\n{SET_GRAVITY}");
        let answer = exchange(runtime.address, bytes.as_bytes());
        let answers = String::from_utf8_lossy(&answer)
            .matches("HTTP/1.1 ")
            .count();
        assert_eq!(answers, 1, "one request, one answer: {head:?}");
    }
    runtime.assert_nothing_was_executed();
}

#[test]
fn a_posted_command_is_not_executed_and_told_so_in_one_line() {
    let runtime = Runtime::start();
    for method in ["POST", "PUT", "HEAD", "OPTIONS", "DELETE", "PATCH"] {
        let request = format!(
            "{method} / HTTP/1.1\r\nHost: {}\r\nContent-Type: text/plain\r\nContent-Length: {}\r\n\r\n{SET_GRAVITY}",
            runtime.address,
            SET_GRAVITY.len()
        );
        let answer = exchange(runtime.address, request.as_bytes());
        let line = String::from_utf8(answer).unwrap();
        assert_eq!(line.lines().count(), 1, "{line}");
        assert!(line.contains("\"level\":\"error\"") && line.contains("HTTP"));
    }
    runtime.assert_nothing_was_executed();
}

#[test]
fn nothing_of_a_request_becomes_a_header_of_the_answer() {
    let runtime = Runtime::start();
    let port = runtime.address.port();
    let paths = [
        "/%0d%0aSet-Cookie:%20a=b",
        "/report/%0d%0aSet-Cookie:%20a=b.svg",
        "/?token=%0d%0aSet-Cookie:%20a=b",
    ];
    for path in paths {
        let answer = get(runtime.address, path);
        assert_eq!(answer.header("set-cookie"), None, "{path}");
    }
    let hosts = [
        format!("localhost:{port}; script-src *"),
        format!("localhost:{port} evil"),
        format!("localhost:{port}\t'unsafe-inline'"),
    ];
    for host in hosts {
        let answer = request(runtime.address, "/", &format!("Host: {host}\r\n"));
        assert_eq!(answer.status, 403, "{host}");
    }
    let origin = format!("Host: localhost:{port}\r\nOrigin: http://evil.example\r\n");
    let answer = request(runtime.address, "/", &origin);
    assert_eq!(answer.header("access-control-allow-origin"), None);
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
