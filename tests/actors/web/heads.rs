//! The parts of a head: headers, escapes and the length of a host. `exchanges/http.txt` has the hosts that are refused.

use pendularm::address::Host;
use pendularm::web::head::{RequestHead, decode};

/// Longest name of a host that DNS allows, in bytes.
const MAX_NAME: usize = 253;

#[test]
fn only_whole_escapes_are_decoded() {
    assert_eq!(decode("a%41%2f").as_deref(), Some("aA/"));
    for text in ["%", "%4", "%4g", "%+1", "%ff", "%\u{e9}"] {
        assert_eq!(decode(text), None, "{text}");
    }
}

#[test]
fn a_header_given_twice_is_not_one() {
    let request = hyper::Request::builder()
        .uri("/a/b?x=1&token=a%2Bb")
        .header("Host", "a")
        .header("Host", "b")
        .header("Cookie", "a=1; b=%20x")
        .header("Connection", "keep-alive, Upgrade");
    let (parts, ()) = request.body(()).unwrap().into_parts();
    let request = RequestHead(parts);
    assert_eq!(request.one("host"), None);
    assert_eq!(request.query("token").as_deref(), Some("a+b"));
    assert_eq!(request.query("y"), None);
    assert_eq!(request.cookie("b").as_deref(), Some(" x"));
    assert!(request.has_word("connection", "upgrade"));
}

#[test]
fn a_name_that_dns_does_not_allow_is_no_host() {
    assert_eq!(Host::parse(&"x".repeat(MAX_NAME + 1)), None);
}
