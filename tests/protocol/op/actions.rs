//! Goals of actions: they are sent and cancelled, and news of them is written.

use bytes::Bytes;
use pendularm::protocol::messages::{action_feedback, action_result};
use pendularm::protocol::op::{ActionGoal, Arguments, Op};
use pendularm::protocol::wire::payload::Payload;
use serde_json::json;
use serde_json::value::RawValue;

use super::op;

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
fn a_cancellation_names_its_action() {
    let cancel = op(r#"{"op":"cancel_action_goal","action":"/ik_action"}"#);
    assert!(matches!(cancel, Op::CancelActionGoal { action } if action == "/ik_action"));
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
