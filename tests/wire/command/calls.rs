//! `action send_goal`.

use serde_json::{Value, json};

use super::{Going, json_of, said};
use crate::common::Runtime;

#[test]
fn a_goal_is_followed_to_its_end_and_a_signal_cancels_it() {
    let runtime = Runtime::start();
    said(&runtime, "service call /pid_controller/enable [true]");
    let goal = "action send_goal /ik_action '{x: 0.5, y: 1.2}'";
    let result = json_of(&runtime, goal);
    assert_eq!(result["status"], "SUCCEEDED");
    assert_eq!(result["result"]["outcome"], "reached");
    let goal = "action send -f /ik_action pendularm_interfaces/action/MoveTo '{x: 1.2, y: 0.5}'";
    let text = said(&runtime, goal);
    assert!(text.starts_with("feedback:\n  goal_id: "), "{text}");
    assert!(text.ends_with("\nstatus: SUCCEEDED\n---\n"), "{text}");

    said(&runtime, "service call /pid_controller/enable [false]");
    let mut child = Going::start(&runtime, &format!("{goal} --json"));
    assert!(child.line().starts_with("{\"feedback\":"));
    child.interrupt();
    let (status, rest, complaint) = child.end();
    let last: Value = serde_json::from_str(rest.lines().last().unwrap()).unwrap();
    assert_eq!((status, &last["status"]), (Some(1), &json!("CANCELED")));
    assert!(
        complaint.ends_with("\npendularm: the goal ended as CANCELED\n"),
        "{complaint}"
    );
}
