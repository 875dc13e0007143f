//! Requests by HEAD, and requests that are refused before they are complete. `tests/actors/exchanges/` has the others.

use crate::common::Runtime;
use crate::web_client::exchange;

/// Health checks use this method.
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

/// A socket that is closed with unread input is reset, and the answer is lost.
#[test]
fn bytes_after_a_refused_head_are_discarded_and_the_answer_can_be_read() {
    let runtime = Runtime::start();
    let long = format!(
        "GET / HTTP/1.1\r\nHost: {}\r\nX: {}\r\n\r\n",
        runtime.address,
        "x".repeat(500_000)
    );
    let posted = format!(
        "POST / HTTP/1.1\r\nContent-Length: 1000000\r\n\r\n{}",
        "x".repeat(1_000_000)
    );
    for (request, part) in [(long, "16384 bytes"), (posted, "HTTP")] {
        let answer = exchange(runtime.address, request.as_bytes());
        let answer = String::from_utf8_lossy(&answer);
        assert!(answer.contains(part), "{answer}");
    }
}
