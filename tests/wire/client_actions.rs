//! Actions that clients pursue: goals, cancellations, progress and ends go to and fro, each side under its own ids.

use std::time::Instant;

use crate::common::{Client, PATIENCE, Runtime};
use serde_json::{Value, json};

/// A client that pursues `/dance`.
fn dancer(runtime: &Runtime) -> Client {
    let mut dancer = runtime.connect();
    dancer
        .send(&json!({"op": "advertise_action", "action": "/dance", "type": "demo/action/Dance"}));
    assert_eq!(dancer.status()["msg"], "advertised action /dance");
    dancer
}

fn goal(id: &str, feedback: bool) -> Value {
    json!({"op": "send_action_goal", "id": id, "action": "/dance", "action_type": "demo/action/Dance",
           "args": {"steps": 3}, "feedback": feedback})
}

fn with_op(client: &mut Client, op: &str) -> Value {
    client.receive_where(op, |frame| frame["op"] == op)
}

#[test]
fn a_goal_goes_to_the_client_that_pursues_it_and_its_progress_and_end_come_back() {
    let runtime = Runtime::start();
    let (mut dancer, mut client) = (dancer(&runtime), runtime.connect());
    client.send(&goal("mine", true));
    let received = with_op(&mut dancer, "send_action_goal");
    assert_eq!(
        (&received["action"], &received["action_type"]),
        (&json!("/dance"), &json!("demo/action/Dance"))
    );
    assert_eq!(
        (&received["args"], &received["feedback"]),
        (&json!({"steps": 3}), &json!(true))
    );
    let id = received["id"].clone();
    assert_ne!(id, "mine");

    dancer.send(
        &json!({"op": "action_feedback", "id": id, "action": "/dance", "values": {"step": 1.0}}),
    );
    assert_eq!(
        with_op(&mut client, "action_feedback"),
        json!({"op": "action_feedback", "id": "mine", "action": "/dance", "values": {"step": 1.0}})
    );
    let end = json!({"op": "action_result", "id": id, "action": "/dance", "values": {"done": true},
                     "status": 4, "result": true});
    dancer.send(&end);
    assert_eq!(
        with_op(&mut client, "action_result"),
        json!({"op": "action_result", "id": "mine", "action": "/dance", "values": {"done": true},
               "status": 4, "result": true})
    );
    dancer.send(&end);
    let why = dancer.status();
    assert!(
        why["msg"].as_str().unwrap().contains("no goal of /dance"),
        "{why}"
    );
}

#[test]
fn only_who_sent_a_goal_can_cancel_it_and_its_pursuer_says_how_it_ends() {
    let runtime = Runtime::start();
    let (mut dancer, mut client) = (dancer(&runtime), runtime.connect());
    client.send(&goal("a", false));
    let id = with_op(&mut dancer, "send_action_goal")["id"].clone();
    let cancel = json!({"op": "cancel_action_goal", "id": "a", "action": "dance"});
    let mut stranger = runtime.connect();
    stranger.send(&cancel);
    assert!(
        stranger.status()["msg"]
            .as_str()
            .unwrap()
            .contains("no goal of dance")
    );
    client.send(&cancel);
    let received = with_op(&mut dancer, "cancel_action_goal");
    assert_eq!(
        received,
        json!({"op": "cancel_action_goal", "id": id, "action": "/dance"})
    );
    // Not asked for: it goes to nobody.
    dancer.send(&json!({"op": "action_feedback", "id": id, "action": "/dance", "values": {}}));
    // As roslib says that it has failed: without values, and without status.
    dancer.send(&json!({"op": "action_result", "id": id, "action": "/dance", "result": false}));
    let end = client.receive();
    assert_eq!(
        end,
        json!({"op": "action_result", "id": "a", "action": "/dance", "values": null, "status": 6, "result": false})
    );
}

#[test]
fn a_goal_outlives_its_sender_and_then_nobody_hears_of_it() {
    let runtime = Runtime::start();
    let (mut dancer, mut client) = (dancer(&runtime), runtime.connect());
    client.send(&goal("a", true));
    let id = with_op(&mut dancer, "send_action_goal")["id"].clone();
    drop(client);
    let gone = |dancer: &mut Client| {
        dancer.send(&json!({"op": "action_feedback", "id": id, "action": "/dance", "values": {}}));
        dancer.settle();
        dancer.kept.iter().any(|frame| frame["level"] == "error")
    };
    // The runtime sees to the end of a connection in its own time, and tells nobody: each look is an exchange.
    let deadline = Instant::now() + PATIENCE;
    while !gone(&mut dancer) {
        assert!(Instant::now() < deadline, "its goal is still heard of");
    }
}

#[test]
fn an_action_that_is_withdrawn_takes_no_goals_but_ends_those_it_has() {
    let runtime = Runtime::start();
    let (mut dancer, mut client) = (dancer(&runtime), runtime.connect());
    client.send(&goal("a", false));
    let id = with_op(&mut dancer, "send_action_goal")["id"].clone();
    dancer.send(&json!({"op": "unadvertise_action", "action": "/dance"}));
    dancer.settle();
    client.send(&goal("b", false));
    assert_eq!(with_op(&mut client, "action_result")["id"], "b");
    dancer.send(
        &json!({"op": "action_result", "id": id, "action": "/dance", "values": {}, "status": 5,
                "result": true}),
    );
    let end = with_op(&mut client, "action_result");
    assert_eq!((&end["id"], &end["status"]), (&json!("a"), &json!(5)));
    dancer.send(&json!({"op": "unadvertise_action", "action": "/dance"}));
    assert_eq!(dancer.status()["level"], "error");
}

#[test]
fn actions_of_clients_are_found_by_asking_and_those_of_the_runtime_stay_its_own() {
    let runtime = Runtime::start();
    let mut dancer = dancer(&runtime);
    let servers = dancer.ask("/rosapi/action_servers", json!({}));
    assert_eq!(
        servers["action_servers"].as_array().unwrap().last(),
        Some(&json!("/dance"))
    );
    let type_of = |dancer: &mut Client, action: &str| {
        dancer.ask("/rosapi/action_type", json!({"action": action}))["type"].clone()
    };
    assert_eq!(type_of(&mut dancer, "dance"), "demo/action/Dance");
    assert_eq!(type_of(&mut dancer, "/none"), "");
    for (frame, word) in [
        (
            json!({"op": "advertise_action", "action": "/ik_action"}),
            "runtime itself",
        ),
        (json!({"op": "advertise_action"}), "action is required"),
        (
            json!({"op": "action_result", "id": "x", "action": "/dance", "result": true, "status": 7}),
            "status",
        ),
        (
            json!({"op": "action_result", "action": "/dance", "result": true}),
            "id is required",
        ),
        (
            json!({"op": "action_feedback", "id": "x", "action": "/dance"}),
            "values is required",
        ),
        (
            json!({"op": "action_feedback", "id": "pendularm:1", "action": "/dance", "values": {}}),
            "no goal",
        ),
    ] {
        dancer.send(&frame);
        let status = dancer.status();
        assert!(status["msg"].as_str().unwrap().contains(word), "{status}");
    }
}

/// The results of broken action servers, and why they are discarded. `ID` stands for the id of the goal.
const BROKEN: [(&str, &str); 9] = [
    (r#"{NAMED,"values":{},"status":4}"#, "result is required"),
    (
        r#"{NAMED,"values":{},"result":"yes"}"#,
        "result must be true or false",
    ),
    (
        r#"{NAMED,"values":{},"result":true,"status":7}"#,
        "status must be",
    ),
    (
        r#"{NAMED,"values":{},"result":true,"status":"done"}"#,
        "status must be",
    ),
    (
        r#"{NAMED,"values":5,"result":true}"#,
        "values must be an object",
    ),
    (
        r#"{"op":"action_result","id":ID,"result":true}"#,
        "action is required",
    ),
    (
        r#"{"op":"action_result","id":ID,"action":"/sing","result":true}"#,
        "is of /dance",
    ),
    (
        r#"{"op":"action_result","action":"dance","result":true}"#,
        "id is required",
    ),
    (r#"{NAMED,"result":True}"#, "malformed frame"),
];

#[test]
fn a_result_that_cannot_be_passed_on_ends_its_goal_and_is_its_servers_error() {
    let runtime = Runtime::start();
    let (mut dancer, mut client) = (dancer(&runtime), runtime.connect());
    let named = r#""op":"action_result","action":"/dance","id":ID"#;
    for (frame, why) in BROKEN {
        client.send(&goal("a", true));
        let id = with_op(&mut dancer, "send_action_goal")["id"].clone();
        // Feedback that cannot be passed on costs nothing but itself.
        for bad in [
            json!({"values": 5}),
            json!({}),
            json!({"values": {}, "action": "/sing"}),
        ] {
            let mut feedback = json!({"op": "action_feedback", "id": id, "action": "/dance"});
            feedback
                .as_object_mut()
                .unwrap()
                .extend(bad.as_object().unwrap().clone());
            dancer.send(&feedback);
            assert_eq!(dancer.status()["level"], "error", "{feedback}");
        }
        let frame = frame.replace("NAMED", named).replace("ID", &id.to_string());
        dancer.send_bytes(format!("{frame}\n").as_bytes());
        let end = client.receive();
        assert_eq!(
            (&end["op"], &end["id"], &end["status"], &end["result"]),
            (
                &json!("action_result"),
                &json!("a"),
                &json!(6),
                &json!(false)
            ),
            "{frame}"
        );
        let values = end["values"].as_str().unwrap();
        assert!(
            values.contains("of /dance") && values.contains(why),
            "{values}"
        );
        let told = dancer.status();
        assert!(told["msg"].as_str().unwrap().contains(why), "{told}");
    }
}
