//! Pages that mean harm: requests as a browser can be made to send them, and what the answers let it do.
//!
//! Attacks by a page in a real browser are in `tests/browser/test_hostile.py`; who may ask, and well-formed refusals, are
//! in `http/`, `websocket/handshake.rs` and `token.rs`.
//!
//! **Invariant:** whatever a page has its visitor's browser send, the arm's parameters stay as they were.

#[cfg(feature = "web")]
use crate::common::{Client, Runtime, SET_GRAVITY};
use serde_json::json;

/// All lines up to the end of the stream, which must come; each is an error status.
fn complaints(client: &mut Client) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut client.stream(), &mut rest).expect("the stream ends");
    for line in rest.lines() {
        let status: serde_json::Value = serde_json::from_str(line).expect("a line of JSON");
        assert_eq!(
            (&status["op"], &status["level"]),
            (&json!("status"), &json!("error"))
        );
        lines.push(status["msg"].as_str().unwrap().to_owned());
    }
    lines
}

/// A hostile name server can make a browser believe that this port is the page's own server. To that, a page may send a
/// request of any method without asking first, and no list of methods has them all.
#[test]
fn a_request_of_whatever_method_is_told_so_and_closed_before_its_body() {
    let runtime = Runtime::start();
    for method in [
        "PROPFIND",
        "patch",
        "X",
        "LINK",
        "M-SEARCH",
        "!#$%&'*+-.^_`|~",
    ] {
        for head in [
            "Host: evil.example:9095\r\nContent-Length: 100\r\n",
            "Accept: */*\r\nContent-Type: text/plain\r\nHOST: evil.example\r\nConnection: keep-alive\r\n",
            "host:evil.example\n",
            "Host:\r\n",
        ] {
            let mut client = runtime.connect();
            let request = format!("{method} / HTTP/1.1\r\n{head}\r\n{SET_GRAVITY}{SET_GRAVITY}");
            client.send_bytes(request.as_bytes());
            let told = complaints(&mut client);
            let last = told.last().expect("a reason");
            assert!(last.contains("HTTP request"), "{method}, {head}: {told:?}");
        }
    }
    runtime.assert_nothing_was_executed();
}

/// The same where the request line is longer than a frame may be, so that nothing of it is kept, and byte by byte.
#[test]
fn a_request_is_known_by_its_head_however_long_its_first_line_and_however_it_is_cut() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let line = format!("LINK /{} HTTP/1.1\r\n", "a".repeat(4 * 1024 * 1024));
    client.send_bytes(line.as_bytes());
    client.send_bytes(format!("Host: evil.example\r\n\r\n{SET_GRAVITY}").as_bytes());
    assert!(
        complaints(&mut client)
            .last()
            .unwrap()
            .contains("HTTP request")
    );

    let mut client = runtime.connect();
    for byte in b"LINK / HTTP/1.1\r\nHost: evil.example\r\n" {
        client.send_bytes(&[*byte]);
    }
    assert!(
        complaints(&mut client)
            .last()
            .unwrap()
            .contains("HTTP request")
    );
    runtime.assert_nothing_was_executed();
}

/// The rule is about how a connection opens: later, and where it only resembles that, a line is malformed and no more.
#[test]
fn a_line_like_one_of_a_head_is_an_ordinary_malformed_frame_elsewhere() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for line in [
        "hostile: x\n",
        "Hos\n",
        "host\n",
        " host x: y\n",
        "get / HTTP/1.1\n",
    ] {
        client.send_bytes(line.as_bytes());
        assert_eq!(client.receive()["level"], "error");
    }
    client.settle();
    client.send_bytes(b"Host: localhost\n");
    assert_eq!(client.receive()["level"], "error");
    client.settle();
}

/// A client that must show a token has to show it first, whatever it looks like.
#[test]
fn a_request_of_whatever_method_is_locked_out_by_the_token_too() {
    let runtime = Runtime::with(&["--token", "open-sesame-once-more"]);
    let mut client = runtime.connect();
    let auth = "{\"op\":\"auth\",\"token\":\"open-sesame-once-more\"}\n";
    let request = format!("LINK / HTTP/1.1\r\nHost: x\r\n\r\n{auth}{SET_GRAVITY}");
    client.send_bytes(request.as_bytes());
    assert!(complaints(&mut client)[0].contains("token"));
    let mut client = runtime.connect();
    client.send_bytes(auth.as_bytes());
    assert_eq!(
        client.ask("/arm_sim/set_params", json!({}))["gravity"],
        9.81
    );
}

#[cfg(feature = "web")]
mod web {
    use std::fs;

    use super::Runtime;
    use crate::web_client::{Answer, exchange, folder, handshake, request};

    /// Headers of every answer to a browser, whatever it is about.
    const STRICT: [(&str, &str); 6] = [
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("cross-origin-resource-policy", "same-origin"),
        ("cross-origin-opener-policy", "same-origin"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
    ];

    fn assert_strict(answer: &Answer, what: &str) {
        for (name, value) in STRICT {
            assert_eq!(answer.header(name), Some(value), "{name} of {what}");
        }
        let policy = answer.header("content-security-policy").expect(what);
        for rule in ["default-src 'none'", "frame-ancestors 'none'"] {
            assert!(
                policy.split("; ").any(|one| one == rule),
                "{policy} of {what}"
            );
        }
        for name in [
            "access-control-allow-origin",
            "access-control-allow-methods",
            "access-control-allow-headers",
            "access-control-allow-credentials",
            "access-control-allow-private-network",
            "server",
        ] {
            assert_eq!(answer.header(name), None, "{name} of {what}");
        }
    }

    #[test]
    fn every_answer_keeps_the_browser_strict_and_allows_no_other_site_anything() {
        let report = folder("strict_report");
        fs::write(report.join("index.html"), "x").unwrap();
        let runtime = Runtime::with(&["--report", report.to_str().unwrap()]);
        let address = runtime.address;
        let origin = format!("Host: {address}\r\nOrigin: http://evil.example\r\n");
        for (path, status) in [
            ("/", 200),
            ("/main.js", 200),
            ("/report/", 200),
            ("/report", 301),
            ("/nothing", 404),
            ("/report/nothing.txt", 404),
        ] {
            let answer = request(address, path, &origin);
            assert_eq!(answer.status, status, "{path}");
            assert_strict(&answer, path);
        }
        assert_strict(&request(address, "/", "Host: evil.example\r\n"), "403");
        assert_strict(&request(address, "/", ""), "400");
        let refused = [
            (handshake(address) + "Origin: http://evil.example\r\n", 403),
            (handshake(address).replace("Version: 13", "Version: 8"), 426),
            (handshake(address).replace("Key: dGhl", "Key: !"), 400),
        ];
        for (headers, status) in refused {
            let answer = request(address, "/", &headers);
            assert_eq!(answer.status, status);
            assert_strict(&answer, &headers);
        }
        let long = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(20_000));
        let answer = Answer::parse(&exchange(address, long.as_bytes()));
        assert_eq!(answer.status, 431);
        assert_strict(&answer, "431");
    }
}
