//! The first bytes of a connection: JSON, or the name of another protocol.

use pendularm::protocol::wire::frame::{Foreign, Opening, opening};

#[test]
fn http_requests_are_recognised_as_soon_as_they_can_be() {
    for method in [
        "GET", "HEAD", "POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH", "PRI",
    ] {
        let request = format!("{method} / HTTP/1.1\r\nHost: x\r\n\r\n{{\"op\":\"x\"}}");
        assert_eq!(
            opening(request.as_bytes()),
            Opening::Foreign(Foreign::Http),
            "{method}"
        );
        for length in 0..=method.len() {
            let prefix = &request.as_bytes()[..length];
            assert_eq!(
                opening(prefix),
                Opening::Undecided,
                "{length} bytes of {method}"
            );
        }
        let known = &request.as_bytes()[..=method.len()];
        assert_eq!(opening(known), Opening::Foreign(Foreign::Http), "{method}");
    }
}

#[test]
fn a_tls_hello_is_recognised() {
    assert_eq!(opening(&[0x16]), Opening::Undecided);
    assert_eq!(opening(&[0x16, 0x03]), Opening::Foreign(Foreign::Tls));
    assert_eq!(
        opening(&[0x16, 0x03, 0x01, 0x00, 0xf5]),
        Opening::Foreign(Foreign::Tls)
    );
    assert_eq!(opening(&[0x16, 0x04, 0x01, 0x01]), Opening::Json);
}

#[test]
fn a_nul_among_the_first_four_bytes_is_bson() {
    for length in 1..=4_usize {
        let mut bytes = vec![b'{'; length];
        bytes[length - 1] = 0;
        assert_eq!(
            opening(&bytes),
            Opening::Foreign(Foreign::Bson),
            "{bytes:?}"
        );
    }
    assert_eq!(opening(b"{\"a\"\0"), Opening::Json);
}

#[test]
fn json_is_known_with_its_fourth_byte_or_its_first_line() {
    for bytes in ["", "{", "{\"", "{\"o", "{}", "\n\n\n", "GE", "G"] {
        assert_eq!(opening(bytes.as_bytes()), Opening::Undecided, "{bytes:?}");
    }
    for bytes in [
        "{\"op",
        "{}\n",
        "x\n",
        "\nx\n",
        "{}\r\n",
        "    ",
        "GETS",
        "GET\n",
        "get / HTTP/1.1",
    ] {
        assert_eq!(opening(bytes.as_bytes()), Opening::Json, "{bytes:?}");
    }
}

#[test]
fn every_foreign_protocol_is_named_in_one_line() {
    for (foreign, name) in [
        (Foreign::Http, "HTTP"),
        (Foreign::Tls, "TLS"),
        (Foreign::Bson, "BSON"),
    ] {
        let line = foreign.explanation();
        assert!(
            line.contains(name) && line.contains("JSON") && !line.contains('\n'),
            "{line}"
        );
    }
}
