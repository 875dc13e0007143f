//! An operation is read from a frame: every one of them, its members in any order, its id.

use pendularm::protocol::op::{Incoming, Op, read};
use pendularm::protocol::wire::fragments::Piece;
use pendularm::protocol::wire::payload::Payload;

use super::{op, status};

fn id(incoming: &Incoming) -> Option<&str> {
    incoming.id.as_ref().map(Payload::get)
}

#[test]
fn every_operation_is_read() {
    assert!(
        matches!(op(r#"{"op":"advertise","topic":"/x","type":"std_msgs/String"}"#),
        Op::Advertise { topic, type_name: Some(kind) } if topic == "/x" && kind == "std_msgs/String")
    );
    assert!(matches!(
        op(r#"{"op":"advertise","topic":"/x"}"#),
        Op::Advertise {
            type_name: None,
            ..
        }
    ));
    assert!(
        matches!(op(r#"{"op":"unadvertise","topic":"/x"}"#), Op::Unadvertise { topic } if topic == "/x")
    );
    assert!(
        matches!(op(r#"{"op":"publish","topic":"/x","msg":{"a": 1}}"#),
        Op::Publish { topic, msg, .. } if topic == "/x" && msg.get() == r#"{"a": 1}"#)
    );
    assert!(
        matches!(op(r#"{"op":"unsubscribe","topic":"/x"}"#), Op::Unsubscribe { topic } if topic == "/x")
    );
    assert!(
        matches!(op(r#"{"op":"advertise_service","service":"/s","type":"a/B"}"#),
        Op::AdvertiseService { service, type_name: Some(kind) } if service == "/s" && kind == "a/B")
    );
    assert!(
        matches!(op(r#"{"op":"unadvertise_service","service":"/s"}"#),
        Op::UnadvertiseService { service } if service == "/s")
    );
    assert!(
        matches!(op(r#"{"op":"service_response","service":"/s","id":"1","values":{},"result":true}"#),
        Op::ServiceResponse { service, values, result: true, status: None } if service == "/s" && values.get() == "{}")
    );
}

#[test]
fn the_values_of_a_response_may_be_anything_and_its_status_counts_if_it_is_text() {
    assert!(matches!(
        op(r#"{"op":"service_response","service":"/s","id":1,"values":"bad","result":false,"status":"why"}"#),
        Op::ServiceResponse { values, result: false, status: Some(status), .. }
            if values.get() == "\"bad\"" && status == "why"));
    assert!(matches!(
        op(
            r#"{"op":"service_response","service":"/s","id":1,"values":null,"result":false,"status":7}"#
        ),
        Op::ServiceResponse { status: None, .. }
    ));
}

#[test]
fn members_come_in_any_order_with_escapes_and_unknown_ones_are_ignored() {
    let frame = r#" { "msg":{}, "latch":true, "\u0074opic" : "/\u0078", "x":[{"op":"advertise"}], "\u006fp":"publish" } "#;
    assert!(matches!(op(frame), Op::Publish { topic, .. } if topic == "/x"));
}

#[test]
fn of_a_repeated_member_the_last_counts() {
    let frame = r#"{"op":"advertise","topic":5,"topic":"/b","id":1,"op":"unadvertise","id":2}"#;
    assert!(matches!(op(frame), Op::Unadvertise { topic } if topic == "/b"));
    assert_eq!(id(&read(frame)), Some("2"));
}

#[test]
fn an_id_is_kept_exactly_as_it_came() {
    for text in [
        "1",
        "\"a b\"",
        "null",
        "123456789012345678901234567890",
        "1.50e0",
        "[1, {\"a\":2}]",
        "-0",
        "\"\\u00e9\"",
    ] {
        let incoming = read(&format!(
            r#"{{"op":"unsubscribe","topic":"/x","id":{text}}}"#
        ));
        assert_eq!(id(&incoming), Some(text));
    }
    assert_eq!(id(&read(r#"{"op":"unsubscribe","topic":"/x"}"#)), None);
}

#[test]
fn an_id_is_known_though_the_operation_is_in_error() {
    for frame in [
        r#"{"id":7}"#,
        r#"{"op":"nonsense","id":7}"#,
        r#"{"op":"publish","id":7}"#,
        r#"{"op":"call_service","service":"/x","timeout":0,"id":7}"#,
        r#"{"op":3,"id":7}"#,
    ] {
        let incoming = read(frame);
        assert!(incoming.op.is_err(), "{frame}");
        assert_eq!(id(&incoming), Some("7"), "{frame}");
    }
}

#[test]
fn what_is_no_operation_is_named() {
    assert!(status("{\"a\":}").starts_with("malformed frame: "));
    let no_object = status("[]");
    assert!(no_object.starts_with("malformed frame: "));
    assert!(no_object.contains("expected a JSON object"), "{no_object}");
    assert!(status("{} {}").starts_with("malformed frame: "));
    assert!(status("{\"a\":01}").starts_with("malformed frame: "));
    assert_eq!(status("{}"), "malformed frame: op is required");
    assert_eq!(
        status(r#"{"op":null}"#),
        "malformed frame: op must be a string, got null"
    );
    assert_eq!(
        status(r#"{"op":{}}"#),
        "malformed frame: op must be a string, got an object"
    );
    // As the frame's reader writes the names that JSON does not have.
    for (literal, name) in [
        ("9e999", "NaN"),
        ("1e999", "Infinity"),
        ("-1e999", "-Infinity"),
        ("-9e999", "-9e999"),
    ] {
        assert_eq!(
            status(&format!(r#"{{"op":{literal}}}"#)),
            format!("malformed frame: op must be a string, got {name}")
        );
    }
    assert_eq!(status(r#"{"op":"fly"}"#), "unknown op \"fly\"");
    assert_eq!(status(r#"{"op":""}"#), "unknown op \"\"");
}

#[test]
fn a_fragment_is_a_piece_with_its_number_and_how_many_there_are() {
    let fragment = op(r#"{"op":"fragment","id":7,"data":"a\"b","num":1,"total":3}"#);
    let Op::Fragment(piece) = fragment else {
        panic!("{fragment:?}");
    };
    assert_eq!(
        piece,
        Piece {
            id: "7".to_owned(),
            data: "a\"b".to_owned(),
            num: 1,
            total: 3,
        }
    );
}
