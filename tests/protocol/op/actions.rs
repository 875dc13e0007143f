//! Goals of actions: they are sent and cancelled, and news of them is written.
//!
//! **Invariant:** a message about bad input is compared whole: it is what its sender has to go by.

use bytes::Bytes;
use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::{action_feedback, action_result};
use pendularm::protocol::op::{ActionGoal, Arguments, Op, read};
use pendularm::protocol::wire::payload::Payload;
use serde_json::json;
use serde_json::value::RawValue;

use super::{op, problem};

#[track_caller]
fn goal(more: &str) -> ActionGoal {
    match op(&format!(
        r#"{{"op":"send_action_goal","action":"/ik_action"{more}}}"#
    )) {
        Op::SendActionGoal(goal) => goal,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_goal_has_an_action_and_perhaps_a_type_arguments_and_feedback() {
    let least = goal("");
    assert_eq!(least.action, "/ik_action");
    assert_eq!(least.type_name, None);
    assert_eq!(least.args.payload().get(), "{}");
    assert!(!least.feedback);
    let most = goal(r#","action_type":"a/b","args":[1],"feedback":true"#);
    assert_eq!(most.type_name.as_deref(), Some("a/b"));
    assert!(matches!(most.args, Arguments::Positional(raw) if raw.get() == "[1]"));
    assert!(most.feedback);
    assert!(!goal(r#","feedback":false"#).feedback);
}

#[test]
fn a_goal_whose_members_are_of_another_type_is_refused_by_their_names() {
    for (more, message) in [
        (
            r#""action":"""#,
            r#"send_action_goal: action must be a non-empty string, got """#,
        ),
        (r#""x":1"#, "send_action_goal: action is required"),
        (
            r#""action":"a","action_type":5"#,
            "send_action_goal: action_type must be a string, got 5",
        ),
        (
            r#""action":"a","feedback":1"#,
            "send_action_goal: feedback must be true or false, got 1",
        ),
    ] {
        let frame = format!(r#"{{"op":"send_action_goal",{more}}}"#);
        assert_eq!(problem(&frame), message);
    }
}

/// It is kept while the goal is pursued, and comes back with every feedback.
#[test]
fn the_id_of_a_goal_is_bounded() {
    let frame = |length: usize| {
        let id = "x".repeat(length - 2);
        format!(r#"{{"op":"send_action_goal","action":"/ik_action","feedback":true,"id":"{id}"}}"#)
    };
    assert!(read(&frame(MAX_NAME)).op.is_ok());
    assert_eq!(
        problem(&frame(MAX_NAME + 1)),
        "send_action_goal: id must be at most 1024 bytes long, got 1025"
    );
}

#[test]
fn a_cancellation_names_its_action() {
    let cancel = op(r#"{"op":"cancel_action_goal","action":"/ik_action"}"#);
    assert!(matches!(cancel, Op::CancelActionGoal { action } if action == "/ik_action"));
    assert_eq!(
        problem(r#"{"op":"cancel_action_goal"}"#),
        "cancel_action_goal: action is required"
    );
}

fn raw(text: &str) -> Payload {
    RawValue::from_string(text.to_owned())
        .expect("valid JSON")
        .into()
}

#[test]
fn progress_and_end_of_a_goal_carry_the_senders_id() {
    let id = raw("[1]");
    assert_eq!(
        action_feedback("/ik_action", Some(&id), &json!({"a": 1})),
        Bytes::from(
            "{\"op\":\"action_feedback\",\"action\":\"/ik_action\",\"id\":[1],\"values\":{\"a\":1}}\n"
        )
    );
    assert_eq!(
        action_result("/ik_action", None, &json!("why"), 6, false),
        Bytes::from(
            "{\"op\":\"action_result\",\"action\":\"/ik_action\",\"values\":\"why\",\"status\":6,\"result\":false}\n"
        )
    );
}
