//! Requests as bytes: heads that are too long, too slow or none, and bodies that nobody executes.

use std::io::Write;
use std::net::{Shutdown, TcpStream};

use crate::common::{PATIENCE, Runtime, SET_GRAVITY};
use crate::web_client::{Answer, exchange, get, request, rest};
use pendularm::web::head::{MAX_HEAD, MAX_HEADERS};

/// A request behind another is one of its own only where nobody can read it as the body of the first.
#[test]
fn no_second_request_is_smuggled_behind_the_first() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let second = format!("GET /nothing HTTP/1.1\r\nHost: {address}\r\n\r\n");
    for (lengths, statuses) in [
        ("", &[200, 404][..]),
        ("Connection: keep-alive\r\n", &[200, 404]),
        ("Content-Length: 0\r\n", &[200, 404]),
        ("Connection: close\r\n", &[200]),
        ("Content-Length: 5\r\nContent-Length: 0\r\n", &[400]),
        ("Content-Length: 5\r\n", &[400]),
        ("Transfer-Encoding: chunked\r\n", &[400]),
        (
            "Transfer-Encoding: chunked\r\nContent-Length: 4\r\n",
            &[400],
        ),
        (
            "Transfer-Encoding: xchunked\r\nContent-Length: -1\r\n",
            &[400],
        ),
    ] {
        let bodies = if statuses == [400] {
            &["", "0\r\n\r\n"][..]
        } else {
            &[""]
        };
        for body in bodies {
            let request =
                format!("GET / HTTP/1.1\r\nHost: {address}\r\n{lengths}\r\n{body}{second}");
            let answers = Answer::parse_all(&exchange(address, request.as_bytes()));
            let came: Vec<u16> = answers.iter().map(|one| one.status).collect();
            assert_eq!(came, statuses, "{lengths}");
        }
    }
}

/// The opening is a GET, so another method can come behind it only.
#[test]
fn another_method_behind_a_request_is_a_405_and_the_last() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let host = format!("Host: {address}\r\n");
    for method in ["POST", "PUT", "OPTIONS", "X"] {
        let request = format!(
            "GET / HTTP/1.1\r\n{host}\r\n{method} / HTTP/1.1\r\n{host}\r\nGET / HTTP/1.1\r\n{host}\r\n"
        );
        let answers = Answer::parse_all(&exchange(address, request.as_bytes()));
        let came: Vec<u16> = answers.iter().map(|one| one.status).collect();
        assert_eq!(came, [200, 405], "{method}");
        assert_eq!(answers[1].header("allow"), Some("GET, HEAD"));
        assert_eq!(answers[1].header("connection"), Some("close"));
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
        let answers = Answer::parse_all(&exchange(runtime.address, bytes.as_bytes()));
        let (first, others) = answers.split_first().unwrap();
        assert!(others.iter().all(|one| one.status == 400), "{head:?}");
        assert!([200, 400].contains(&first.status), "{head:?}");
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
