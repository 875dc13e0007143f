//! Goals as a rosbridge action, `/ik_action`: the same goal machine as behind the services.
//!
//! **Invariant:** every goal that is sent has exactly one `action_result`.

use crate::arm::ticks;
use crate::common::{Client, Runtime};
use pendularm::protocol::catalog::Action;
use serde_json::{Value, json};

fn goal(id: &str, args: &Value) -> Value {
    json!({"op": "send_action_goal", "id": id, "action": "/ik_action",
        "action_type": "pendularm_interfaces/action/MoveTo", "args": args, "feedback": true})
}

fn result(client: &mut Client) -> Value {
    client.receive_where("result", |frame| frame["op"] == "action_result")
}

#[test]
fn a_goal_is_followed_to_its_end_under_the_clients_own_id() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    other.subscribe("/ik_action/result");
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&goal("mine", &json!({"x": 0.5, "y": 1.2})));
    let end = result(&mut client);
    assert_eq!(
        (&end["id"], &end["action"], &end["status"], &end["result"]),
        (
            &json!("mine"),
            &json!("/ik_action"),
            &json!(4),
            &json!(true)
        )
    );
    assert_eq!(end["values"]["outcome"], "reached");
    assert!(end["values"]["final_distance"].as_f64().unwrap() <= 0.02);
    let feedback: Vec<&Value> = client
        .kept
        .iter()
        .filter(|one| one["op"] == "action_feedback")
        .collect();
    assert!(feedback.len() > 10, "{} of 60 a second", feedback.len());
    for one in feedback {
        assert_eq!(
            (&one["id"], &one["action"]),
            (&json!("mine"), &json!("/ik_action"))
        );
        assert_eq!(one["values"]["goal_id"], end["values"]["goal_id"]);
    }
    // Both doors tell the same.
    assert_eq!(other.message("/ik_action/result"), end["values"]);
    // Behind what the arm has said to `ik_action` until then, which answers this.
    client.subscribe("/joint_states");
    ticks(&mut client, 12);
    client.refusal("/ik_action/cancel_goal", json!({}));
    let again = |one: &Value| one["op"] == "action_result";
    assert!(!client.kept.iter().any(again));
}

#[test]
fn a_goal_without_feedback_has_none_and_answers_in_the_spelling_that_was_used() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&json!({"op": "send_action_goal", "action": "ik_action", "args": [-0.5, 1.2]}));
    let mut other = runtime.connect();
    other.subscribe("/joint_states");
    ticks(&mut other, 18);
    assert!(client.so_far().is_empty());
    client.ask("/arm_sim/reset", json!({}));
    let end = client.kept.pop().unwrap_or_else(|| result(&mut client));
    assert_eq!(end["action"], "ik_action");
    assert!(end.get("id").is_none(), "{end}");
    assert_eq!((&end["status"], &end["result"]), (&json!(6), &json!(true)));
    assert_eq!(end["values"]["outcome"], "preempted");
}

#[test]
fn a_goal_that_is_refused_has_one_result_that_says_why() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (frame, word) in [
        (goal("a", &json!({"x": 5.0, "y": 5.0})), "reach"),
        (goal("a", &json!({"x": 1.0})), "y is required"),
        (goal("a", &json!("there")), "args"),
        (
            json!({"op": "send_action_goal", "id": "a", "action": "/none"}),
            "/none",
        ),
        (
            json!({"op": "send_action_goal", "id": "a", "action": "/ik_action", "action_type": "demo/Other"}),
            "action_type",
        ),
    ] {
        client.send(&frame);
        let end = client.receive();
        assert_eq!(
            (&end["op"], &end["id"]),
            (&json!("action_result"), &json!("a")),
            "{end}"
        );
        assert_eq!((&end["status"], &end["result"]), (&json!(0), &json!(false)));
        assert!(end["values"].as_str().unwrap().contains(word), "{end}");
    }
    client.send(&json!({"op": "send_action_goal"}));
    assert_eq!(client.receive()["level"], "error");
    for (member, value) in [
        ("feedback", json!(1)),
        ("action_type", json!(5)),
        ("args", json!({"x": "x".repeat(20_000)})),
        ("id", json!("x".repeat(2000))),
    ] {
        let mut frame = json!({"op": "send_action_goal", "id": "a", "action": "/ik_action"});
        frame[member] = value;
        client.send(&frame);
        let (status, end) = (client.receive(), client.receive());
        assert_eq!(status["level"], "error", "{status}");
        assert_eq!(
            (&end["op"], &end["id"], &end["status"], &end["result"]),
            (
                &json!("action_result"),
                &frame["id"],
                &json!(0),
                &json!(false)
            )
        );
        assert!(end["values"].as_str().unwrap().contains(member), "{end}");
    }
}

#[test]
fn a_cancelled_goal_ends_as_cancelled_and_only_its_own_client_can_do_that() {
    let runtime = Runtime::start();
    let (mut client, mut stranger) = (runtime.connect(), runtime.connect());
    client.send(&goal("mine", &json!({"x": 0.5, "y": 1.2})));
    client.settle();
    let cancel = json!({"op": "cancel_action_goal", "id": "mine", "action": "/ik_action"});
    stranger.send(&cancel);
    assert_eq!(stranger.receive()["level"], "error");
    client.send(&cancel);
    let end = result(&mut client);
    assert_eq!(
        (&end["id"], &end["status"], &end["result"]),
        (&json!("mine"), &json!(5), &json!(true))
    );
    client.send(&cancel);
    assert_eq!(client.status()["level"], "error", "it has ended");
}

#[test]
fn a_new_goal_by_either_door_aborts_the_one_before() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    client.send(&goal("first", &json!({"x": 0.5, "y": 1.2})));
    client.send(&goal("second", &json!({"x": 0.5, "y": -1.2})));
    let end = result(&mut client);
    assert_eq!((&end["id"], &end["status"]), (&json!("first"), &json!(6)));
    other.ask("/ik_action/send_goal", json!({"x": 1.0, "y": 1.0}));
    let end = result(&mut client);
    assert_eq!((&end["id"], &end["status"]), (&json!("second"), &json!(6)));
    other.ask("/ik_action/cancel_goal", json!({}));
}

#[test]
fn a_goal_outlives_the_client_that_sent_it() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    other.subscribe("/ik_action/result");
    other.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&goal("mine", &json!({"x": 0.5, "y": 1.2})));
    client.settle();
    drop(client);
    assert_eq!(other.message("/ik_action/result")["outcome"], "reached");
}

#[test]
fn the_action_is_found_by_asking() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let servers = client.ask("/rosapi/action_servers", json!({}));
    assert_eq!(
        servers["action_servers"],
        json!(Action::ALL.map(Action::name))
    );
    let type_name =
        client.ask("/rosapi/action_type", json!({"action": "ik_action"}))["type"].clone();
    for (question, name, field) in [
        ("action_goal_details", "Goal", "success_hold"),
        ("action_result_details", "Result", "final_distance"),
        ("action_feedback_details", "Feedback", "distance_remaining"),
    ] {
        let details = client.ask(&format!("/rosapi/{question}"), json!({"type": type_name}));
        let first = &details["typedefs"][0];
        assert_eq!(first["type"], format!("pendularm_interfaces/MoveTo_{name}"));
        assert!(
            first["fieldnames"]
                .as_array()
                .unwrap()
                .contains(&json!(field)),
            "{first}"
        );
    }
}
