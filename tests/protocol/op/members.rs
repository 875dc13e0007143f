//! Members that an operation must have, and their types.

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::op::Op;

use super::{op, status};

#[test]
fn a_missing_required_field_is_named() {
    for (frame, field) in [
        (r#"{"op":"advertise"}"#, "topic"),
        (r#"{"op":"unadvertise"}"#, "topic"),
        (r#"{"op":"publish","msg":{}}"#, "topic"),
        (r#"{"op":"publish","topic":"/x"}"#, "msg"),
        (r#"{"op":"subscribe"}"#, "topic"),
        (r#"{"op":"unsubscribe"}"#, "topic"),
        (r#"{"op":"advertise_service"}"#, "service"),
        (r#"{"op":"unadvertise_service"}"#, "service"),
        (r#"{"op":"call_service"}"#, "service"),
        (
            r#"{"op":"service_response","id":1,"values":{},"result":true}"#,
            "service",
        ),
        (
            r#"{"op":"service_response","service":"/s","values":{},"result":true}"#,
            "id",
        ),
        (
            r#"{"op":"service_response","service":"/s","id":1,"result":true}"#,
            "values",
        ),
        (
            r#"{"op":"service_response","service":"/s","id":1,"values":{}}"#,
            "result",
        ),
    ] {
        let message = status(frame);
        assert!(
            message.ends_with(&format!(": {field} is required")),
            "{message}"
        );
    }
}

#[test]
fn a_name_is_a_non_empty_string_of_bounded_length() {
    let long = format!("\"/{}\"", "x".repeat(MAX_NAME));
    for (op, field) in [
        ("advertise", "topic"),
        ("unadvertise", "topic"),
        ("publish", "topic"),
        ("subscribe", "topic"),
        ("unsubscribe", "topic"),
        ("advertise_service", "service"),
        ("unadvertise_service", "service"),
        ("call_service", "service"),
        ("service_response", "service"),
    ] {
        for bad in [
            "5",
            "null",
            "true",
            "[]",
            "{}",
            "\"\"",
            "\"\\ud800\"",
            &long,
        ] {
            let frame = format!(
                r#"{{"op":"{op}","{field}":{bad},"msg":{{}},"id":1,"values":{{}},"result":true}}"#
            );
            let message = status(&frame);
            assert!(
                message.starts_with(&format!("{op}: {field} must be ")),
                "{message}"
            );
            assert!(message.len() < 200, "{message}");
        }
    }
    let longest = "x".repeat(MAX_NAME);
    let frame = format!(r#"{{"op":"advertise","topic":"{longest}"}}"#);
    assert!(matches!(op(&frame), Op::Advertise { topic, .. } if topic == longest));
}

#[test]
fn a_bad_type_is_named() {
    for op in ["advertise", "subscribe", "advertise_service"] {
        for bad in ["5", "null", "{}"] {
            let frame = format!(r#"{{"op":"{op}","topic":"/x","service":"/x","type":{bad}}}"#);
            assert!(status(&frame).starts_with(&format!("{op}: type must be a string, got ")));
        }
    }
}

#[test]
fn a_message_is_an_object() {
    for bad in ["5", "null", "\"x\"", "[]"] {
        let message = status(&format!(r#"{{"op":"publish","topic":"/x","msg":{bad}}}"#));
        assert!(
            message.starts_with("publish: msg must be an object, got "),
            "{message}"
        );
    }
}

#[test]
fn the_values_of_a_response_without_fault_are_an_object() {
    for bad in ["5", "null", "\"x\"", "[]"] {
        let message = status(&format!(
            r#"{{"op":"service_response","service":"/s","id":1,"result":true,"values":{bad}}}"#
        ));
        assert!(
            message.starts_with("service_response: values must be an object, got "),
            "{message}"
        );
    }
}

#[test]
fn the_result_of_a_response_is_true_or_false() {
    for bad in ["1", "null", "\"true\""] {
        let frame = format!(
            r#"{{"op":"service_response","service":"/s","id":1,"values":{{}},"result":{bad}}}"#
        );
        assert_eq!(
            status(&frame),
            format!("service_response: result must be true or false, got {bad}")
        );
    }
}
