//! The operations that clients send.
//!
//! **Invariant:** every bad field is tried in every operation that has it.

use std::time::Duration;

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::{ErrorForm, Level};
use pendularm::protocol::op::{
    Arguments, CallService, Incoming, MAX_QUEUE_LENGTH, MAX_THROTTLE, MAX_TIMEOUT, Op, OpError,
    Subscribe, read,
};
use pendularm::protocol::wire::payload::Payload;
use proptest::prelude::*;

fn op(frame: &str) -> Op {
    read(frame)
        .op
        .unwrap_or_else(|error| panic!("{frame}: {error}"))
}

/// The message of an error that is answered by a status.
fn status(frame: &str) -> String {
    match read(frame).op {
        Err(error @ OpError::Status(_)) => error.to_string(),
        other => panic!("{frame}: {other:?}"),
    }
}

/// The service and message of an error that is answered by a service response.
fn failed_call(frame: &str) -> (String, String) {
    match read(frame).op {
        Err(OpError::Call { service, problem }) => (service, problem.to_string()),
        other => panic!("{frame}: {other:?}"),
    }
}

fn subscribe(more: &str) -> Subscribe {
    match op(&format!(r#"{{"op":"subscribe","topic":"/x"{more}}}"#)) {
        Op::Subscribe(subscribe) => subscribe,
        other => panic!("{other:?}"),
    }
}

fn call(more: &str) -> CallService {
    match op(&format!(r#"{{"op":"call_service","service":"/x"{more}}}"#)) {
        Op::CallService(call) => call,
        other => panic!("{other:?}"),
    }
}

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

#[test]
fn a_subscription_has_no_throttle_and_holds_one_message_unless_it_says_otherwise() {
    let plain = subscribe("");
    assert_eq!(
        (
            plain.throttle,
            plain.queue_length,
            plain.type_name.as_deref()
        ),
        (Duration::ZERO, 1, None)
    );
    for none in ["0", "0.0", "-0"] {
        let unthrottled = subscribe(&format!(r#","throttle_rate":{none}"#));
        assert_eq!(unthrottled, plain, "{none}");
    }
    let full = subscribe(r#","type":"a/B","throttle_rate":250.5,"queue_length":3"#);
    assert_eq!(full.throttle, Duration::from_micros(250_500));
    assert_eq!(
        (full.queue_length, full.type_name.as_deref()),
        (3, Some("a/B"))
    );
}

#[test]
fn a_queue_length_of_zero_counts_as_one_and_floats_may_be_integers() {
    for (text, length) in [
        ("0", 1),
        ("-0", 1),
        ("1", 1),
        ("2.0", 2),
        ("1e1", 10),
        ("1e300", MAX_QUEUE_LENGTH),
    ] {
        assert_eq!(
            subscribe(&format!(r#","queue_length":{text}"#)).queue_length,
            length,
            "{text}"
        );
    }
}

#[test]
fn a_huge_throttle_rate_is_clamped() {
    for text in ["1e300", "1e15", "99999999999999999999999999"] {
        assert_eq!(
            subscribe(&format!(r#","throttle_rate":{text}"#)).throttle,
            MAX_THROTTLE,
            "{text}"
        );
    }
    // A year.
    assert_eq!(MAX_THROTTLE, Duration::from_secs(31_536_000));
    assert_eq!(
        subscribe(r#","throttle_rate":1e-300"#).throttle,
        Duration::ZERO
    );
}

#[test]
fn a_bad_optional_value_of_a_subscription_is_named() {
    let long = format!("\"{}\"", "x".repeat(MAX_NAME));
    for (field, bad) in [
        ("throttle_rate", "-1"),
        ("throttle_rate", "1e999"),
        ("throttle_rate", "-1e999"),
        ("throttle_rate", "null"),
        ("throttle_rate", "\"5\""),
        ("throttle_rate", "true"),
        ("queue_length", "-1"),
        ("queue_length", "1.5"),
        ("queue_length", "1e999"),
        ("queue_length", "null"),
        ("queue_length", "true"),
        ("type", "null"),
        ("id", &long),
    ] {
        let message = status(&format!(
            r#"{{"op":"subscribe","topic":"/x","{field}":{bad}}}"#
        ));
        assert!(
            message.starts_with(&format!("subscribe: {field} must be ")),
            "{message}"
        );
        assert!(message.len() < 200, "{message}");
    }
}

#[test]
fn a_level_is_one_of_four_and_says_which_statuses_are_wanted() {
    for (name, wanted) in [
        ("info", [true, true, true]),
        ("warning", [false, true, true]),
        ("error", [false, false, true]),
        ("none", [false, false, false]),
    ] {
        let frame = format!(r#"{{"op":"set_level","level":"{name}"}}"#);
        let Op::SetLevel { verbosity, errors } = op(&frame) else {
            panic!("{name} is a level");
        };
        assert_eq!(errors, None);
        assert_eq!(Level::ALL.map(|level| verbosity.wants(level)), wanted);
    }
    assert_eq!(
        status(r#"{"op":"set_level"}"#),
        "set_level: level is required"
    );
    for level in [r#""loud""#, r#""Info""#, "3", "null"] {
        let status = status(&format!(r#"{{"op":"set_level","level":{level}}}"#));
        let expected = "set_level: level must be info, warning, error or none, got ";
        assert!(status.starts_with(expected), "{status}");
    }
}

#[test]
fn the_form_of_errors_is_one_of_two() {
    for (name, form) in [("object", ErrorForm::Object), ("text", ErrorForm::Text)] {
        let frame = format!(r#"{{"op":"set_level","level":"none","errors":"{name}"}}"#);
        let Op::SetLevel { errors, .. } = op(&frame) else {
            panic!("{name} is a form");
        };
        assert_eq!(errors, Some(form));
    }
    for form in [r#""words""#, "true", "null"] {
        let frame = format!(r#"{{"op":"set_level","level":"none","errors":{form}}}"#);
        let status = status(&frame);
        let expected = "set_level: errors must be object or text, got ";
        assert!(status.starts_with(expected), "{status}");
    }
}

#[test]
fn a_token_is_a_string_and_what_is_wrong_with_it_is_told_without_repeating_it() {
    let Op::Auth { token } = op(r#"{"op":"auth","token":"secr\u0065t"}"#) else {
        panic!("it shows a token");
    };
    assert_eq!(token, "secret");
    assert_eq!(status(r#"{"op":"auth"}"#), "auth: token is required");
    let mistyped = status(r#"{"op":"auth","token":["secret"]}"#);
    assert!(mistyped.starts_with("auth: token must be a string") && !mistyped.contains("secret"));
    let long = format!(r#"{{"op":"auth","token":"{}"}}"#, "s".repeat(MAX_NAME + 1));
    assert!(status(&long).contains("at most 1024 bytes"));
}

#[test]
fn absent_arguments_are_an_empty_object() {
    for more in ["", r#","args":null"#, r#","args":{}"#] {
        assert!(
            matches!(call(more).args, Arguments::Object(raw) if raw.get() == "{}"),
            "{more}"
        );
    }
    assert!(
        matches!(call(r#","args":{"a":1}"#).args, Arguments::Object(raw) if raw.get() == r#"{"a":1}"#)
    );
    assert!(
        matches!(call(r#","args":[1]"#).args, Arguments::Positional(raw) if raw.get() == "[1]")
    );
}

#[test]
fn arguments_of_another_type_are_left_to_whoever_takes_the_call() {
    for bad in ["5", "\"x\"", "true", "false"] {
        let args = call(&format!(r#","args":{bad}"#)).args;
        assert!(
            matches!(args, Arguments::Neither(raw) if raw.get() == bad),
            "{bad}"
        );
    }
}

#[test]
fn a_timeout_is_a_positive_number_of_seconds_and_bounded() {
    assert_eq!(call("").timeout, None);
    assert_eq!(
        call(r#","timeout":1.5"#).timeout,
        Some(Duration::from_millis(1500))
    );
    assert_eq!(call(r#","timeout":1e300"#).timeout, Some(MAX_TIMEOUT));
    // A day.
    assert_eq!(MAX_TIMEOUT, Duration::from_secs(86_400));
    for bad in ["0", "-1", "1e999", "null", "\"1\"", "true"] {
        let (service, message) = failed_call(&format!(
            r#"{{"op":"call_service","service":"/x","timeout":{bad}}}"#
        ));
        assert_eq!(service, "/x");
        assert!(
            message.starts_with("call_service: timeout must be "),
            "{message}"
        );
    }
}

#[test]
fn client_text_in_a_message_is_short_and_without_control_characters() {
    let long = "x".repeat(1_000_000);
    for frame in [
        format!(r#"{{"op":"{long}"}}"#),
        format!(r#"{{"op":"\u001b\n{long}"}}"#),
        format!(r#"{{"op":"publish","topic":"/x","msg":"{long}"}}"#),
        format!(r#"{{"op":"publish","topic":{}}}"#, "9".repeat(1_000_000)),
        format!(r#""{long}""#),
        "{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":\"\u{7f}\u{9b}\"}".to_owned(),
    ] {
        let message = status(&frame);
        assert!(message.chars().count() < 250, "{message}");
        assert!(!message.chars().any(char::is_control), "{message}");
    }
}

/// Payloads are skipped, not parsed, so that their depth costs no stack.
#[test]
fn deep_payloads_are_no_danger() {
    let deep = "[".repeat(100_000) + &"]".repeat(100_000);
    let frame = format!(r#"{{"op":"publish","topic":"/x","msg":{{"a":{deep}}}}}"#);
    assert!(matches!(op(&frame), Op::Publish { .. }));
}

proptest! {
    #[test]
    fn no_frame_makes_the_reader_panic(text in any::<String>()) {
        let _ = read(&text);
    }

    #[test]
    fn no_member_makes_the_reader_panic(
        op in proptest::sample::select(vec!["advertise", "publish", "subscribe", "call_service", "service_response"]),
        members in proptest::collection::vec((
            proptest::sample::select(vec![
                "id", "topic", "type", "msg", "throttle_rate", "queue_length", "service", "args", "timeout", "values", "result", "status",
            ]),
            proptest::sample::select(vec![
                "1", "-1", "0", "1e999", "1e308", "null", "true", "\"/x\"", "\"\"", "{}", "[]", "[1,2]",
            ]),
        ), 0..8),
    ) {
        let members: String = members.iter().map(|(key, value)| format!(",\"{key}\":{value}")).collect();
        let _ = read(&format!("{{\"op\":\"{op}\"{members}}}"));
    }
}
