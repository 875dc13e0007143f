//! The first bytes of a connection: JSON, or the name of another protocol. `tests/actors/exchanges/frames.txt` has what
//! the clients of another protocol are told.

use pendularm::protocol::wire::frame::{Foreign, Opening, opening};

const METHODS: [&str; 10] = [
    "GET", "HEAD", "POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH", "PRI",
];

#[test]
fn http_requests_are_recognised_as_soon_as_they_can_be() {
    for method in METHODS {
        let request = format!("{method} / HTTP/1.1\r\nHost: x\r\n\r\n{{\"op\":\"x\"}}");
        for length in 0..=request.len() {
            let expected = if length <= method.len() {
                Opening::Undecided
            } else {
                Opening::Foreign(Foreign::Http)
            };
            let found = opening(&request.as_bytes()[..length]);
            assert_eq!(found, expected, "{length} bytes of {method}");
        }
    }
}

#[test]
fn tls_bson_and_json_are_recognised() {
    let tls: &[&[u8]] = &[b"\x16\x03", b"\x16\x03\x01\0\xf5"];
    let bson: &[&[u8]] = &[b"\0", b"{\0", b"{{\0", b"{{{\0"];
    // JSON is known with its fourth byte or its first line.
    let json: &[&[u8]] = &[
        b"\x16\x04\x01\x01",
        b"{\"a\"\0",
        b"{\"op",
        b"{}\n",
        b"x\n",
        b"\nx\n",
        b"{}\r\n",
        b"    ",
        b"GETS",
        b"GET\n",
        b"get / HTTP/1.1",
    ];
    let undecided: &[&[u8]] = &[b"", b"\x16", b"{", b"{\"", b"{\"o", b"{}", b"\n\n\n", b"GE"];
    for (expected, all) in [
        (Opening::Foreign(Foreign::Tls), tls),
        (Opening::Foreign(Foreign::Bson), bson),
        (Opening::Json, json),
        (Opening::Undecided, undecided),
    ] {
        for bytes in all {
            assert_eq!(opening(bytes), expected, "{:?}", bytes.escape_ascii());
        }
    }
}
