//! Members that an operation must have, and their types: one table of all operations.

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::op::{Op, read};
use serde_json::{Map, Value};

use super::{op, problem};

/// The text about a bad member, in each form that the sender receives.
fn refusal(op: &str, members: &str) -> String {
    problem(&format!(r#"{{"op":"{op}"{members}}}"#))
}

/// Operation, and the members that it must have, with good values.
const REQUIRED: [(&str, &str); 12] = [
    ("advertise", r#"{"topic":"/x"}"#),
    ("unadvertise", r#"{"topic":"/x"}"#),
    ("publish", r#"{"topic":"/x","msg":{}}"#),
    ("subscribe", r#"{"topic":"/x"}"#),
    ("unsubscribe", r#"{"topic":"/x"}"#),
    ("advertise_service", r#"{"service":"/s"}"#),
    ("unadvertise_service", r#"{"service":"/s"}"#),
    ("call_service", r#"{"service":"/s"}"#),
    (
        "service_response",
        r#"{"service":"/s","id":1,"result":true}"#,
    ),
    ("send_action_goal", r#"{"action":"/a"}"#),
    ("cancel_action_goal", r#"{"action":"/a"}"#),
    ("fragment", r#"{"id":1,"data":"x","num":0,"total":1}"#),
];

fn required(op: &str) -> Map<String, Value> {
    let found = REQUIRED.iter().find(|(name, _)| *name == op);
    serde_json::from_str(found.unwrap().1).unwrap()
}

/// The required members of an operation without `left_out`, as they follow its name.
fn others(op: &str, left_out: &str) -> String {
    let members = required(op).into_iter();
    let kept = members.filter(|(name, _)| *name != left_out);
    kept.map(|(name, value)| format!(r#","{name}":{value}"#))
        .collect()
}

#[test]
fn a_missing_required_member_is_named() {
    for (op, _) in REQUIRED {
        for (name, _) in required(op) {
            let expected = format!("{op}: {name} is required");
            assert_eq!(refusal(op, &others(op, &name)), expected);
        }
    }
    assert_eq!(refusal("set_level", ""), "set_level: level is required");
}

#[test]
fn a_name_is_a_non_empty_string_of_bounded_length() {
    let long = format!("\"/{}\"", "x".repeat(MAX_NAME));
    for (op, _) in REQUIRED {
        let is_name = |good: &Value| good.as_str().is_some_and(|good| good.starts_with('/'));
        let Some((name, _)) = required(op).into_iter().find(|(_, good)| is_name(good)) else {
            continue;
        };
        for bad in [
            "5",
            "null",
            "true",
            "[]",
            "{}",
            r#""""#,
            r#""\ud800""#,
            &long,
        ] {
            let members = format!(r#"{},"{name}":{bad}"#, others(op, &name));
            let message = refusal(op, &members);
            let expected = format!("{op}: {name} must be ");
            assert!(message.starts_with(&expected), "{bad}: {message}");
            assert!(message.len() < 200, "{message}");
        }
    }
    let longest = "x".repeat(MAX_NAME);
    let frame = format!(r#"{{"op":"advertise","topic":"{longest}"}}"#);
    assert!(matches!(op(&frame), Op::Advertise { topic, .. } if topic == longest));
}

/// A row: operation, member, bad literals, and what the member must be.
const BAD: &str = include_str!("members.txt");

#[test]
fn a_bad_member_is_refused_with_what_it_must_be() {
    for row in BAD.lines() {
        let (names, row) = row.split_once(": ").unwrap();
        let (literals, expected) = row.split_once(" => ").unwrap();
        let (op, name) = names.split_once(' ').unwrap();
        for bad in literals.split(' ') {
            let others = match op {
                "set_level" if name == "errors" => r#","level":"none""#.to_owned(),
                "set_level" => String::new(),
                _ => others(op, name),
            };
            let message = refusal(op, &format!(r#"{others},"{name}":{bad}"#));
            let expected = format!("{op}: {name} must be {expected}");
            assert!(message.starts_with(&expected), "{bad}: {message}");
        }
    }
}

/// An id is kept as long as its call or goal, and is returned with every answer. Its quotes count, because an id is any
/// JSON value.
#[test]
fn an_id_that_is_kept_is_bounded() {
    let id = |length: usize| format!(r#","id":"{}""#, "x".repeat(length - 2));
    for op in ["send_action_goal", "subscribe", "fragment"] {
        let longest = format!(r#"{{"op":"{op}"{}{}}}"#, others(op, "id"), id(MAX_NAME));
        assert!(read(&longest).op.is_ok(), "{op}");
        let message = refusal(op, &(others(op, "id") + &id(MAX_NAME + 1)));
        let got = MAX_NAME + 1;
        let expected = format!("{op}: id must be at most {MAX_NAME} bytes long, got {got}");
        assert_eq!(message, expected);
    }
}
