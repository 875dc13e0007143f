//! Goals of the running program, as any client meets them: envelopes, acceptance and rejection, and one that is reached.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";
const RESULT: &str = "/ik_action/result";
const FEEDBACK: &str = "/ik_action/feedback";

fn send_goal(client: &mut Client, args: Value) -> String {
    let values = client.ask(SEND, args);
    values["goal_id"].as_str().unwrap().to_owned()
}

fn keys(message: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = message
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys
}

#[test]
fn an_arm_under_control_reaches_its_goal_and_says_so_once() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        client.subscribe(RESULT);
        client.subscribe(FEEDBACK);
        client.ask("/pid_controller/enable", json!({"data": true}));
        let goal_id = send_goal(&mut client, json!({"x": 0.5, "y": 1.2}));
        let result = client.message(RESULT);
        assert_eq!(
            keys(&result),
            ["final_distance", "goal_id", "outcome", "target"]
        );
        assert_eq!(result["goal_id"], goal_id);
        assert_eq!(result["outcome"], "reached");
        assert_eq!(result["target"], json!({"x": 0.5, "y": 1.2}));
        assert!(result["final_distance"].as_f64().unwrap() <= 0.02);
        let feedback = client
            .kept
            .iter()
            .find(|frame| frame["topic"] == FEEDBACK)
            .unwrap();
        assert_eq!(
            keys(&feedback["msg"]),
            [
                "distance_remaining",
                "elapsed",
                "goal_id",
                "positions",
                "target"
            ]
        );
        let positions = feedback["msg"]["positions"].as_array().unwrap();
        assert_eq!(positions.len(), links);
        assert_eq!(client.refusal(CANCEL, json!({})), "no goal is active");
    }
}

#[test]
fn a_reachable_goal_preempts_and_an_unreachable_one_does_not() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe(RESULT);
    let first = send_goal(&mut client, json!({"x": 1, "y": 1}));
    let rejected = client.call(SEND, json!({"x": 3, "y": 0}));
    assert_eq!(rejected["result"], false);
    assert_eq!(rejected["values"], json!({}));
    let second = send_goal(&mut client, json!({"x": -1, "y": 1}));
    assert_ne!(first, second);
    client.ask(CANCEL, json!({"goal_id": second}));
    let results: Vec<Value> = client
        .kept
        .iter()
        .filter(|frame| frame["topic"] == RESULT)
        .map(|frame| json!([frame["msg"]["goal_id"], frame["msg"]["outcome"]]))
        .collect();
    assert_eq!(
        results,
        [json!([first, "preempted"]), json!([second, "preempted"])]
    );
}

#[test]
fn a_cancellation_whose_goal_id_is_null_names_no_goal() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let cancel = "/ik_action/cancel_goal";
    send_goal(&mut client, json!({"x": 1, "y": 1}));
    assert_eq!(client.ask(cancel, json!({"goal_id": null})), json!({}));
    client.refusal(cancel, json!({"goal_id": null}));
}

#[test]
fn a_goals_trajectory_reaches_every_subscriber() {
    let runtime = Runtime::with_links(3);
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    other.subscribe("/joint_trajectory");
    send_goal(&mut client, json!({"x": 1, "y": 1, "phi": 0.5}));
    let trajectory = other.message("/joint_trajectory");
    assert_eq!(
        trajectory["joint_names"],
        json!(["joint1", "joint2", "joint3"])
    );
    let positions = trajectory["points"][0]["positions"].as_array().unwrap();
    assert_eq!(positions.len(), 3);
}

/// On a busy machine as on an idle one: whatever is pipelined is answered in order and leaves no goal behind.
#[test]
fn goals_cancellations_and_resets_in_one_packet_take_effect_in_order() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.subscribe(RESULT);
    let call = |service: &str, args: Value| {
        let frame = json!({"op": "call_service", "service": service, "args": args});
        format!("{frame}\n")
    };
    let round = [
        call(SEND, json!({"x": 1, "y": 1})),
        call(SEND, json!({"x": 1, "y": -1})),
        call("/arm_sim/reset", json!({})),
        call(CANCEL, json!({})),
    ];
    client.send_bytes(round.concat().repeat(100).as_bytes());
    for round in 0..100 {
        let first = format!("goal-{}", 2 * round + 1);
        let second = format!("goal-{}", 2 * round + 2);
        let mut said = Vec::new();
        while said.len() < 6 {
            let frame = client.receive();
            said.push(match frame["op"].as_str() {
                Some("publish") => frame["msg"]["goal_id"].clone(),
                _ => json!([frame["service"], frame["result"]]),
            });
        }
        let expected = [
            json!([SEND, true]),
            json!(first),
            json!([SEND, true]),
            json!(second),
            json!(["/arm_sim/reset", true]),
            json!([CANCEL, false]),
        ];
        assert_eq!(said, expected);
    }
}

/// Clients on threads of their own, the arm on its own: goals, cancellations and resets meet as they please.
#[test]
fn every_goal_has_exactly_one_result_whatever_clients_do_at_the_same_time() {
    let runtime = Runtime::start();
    let mut listener = runtime.connect();
    listener.subscribe(RESULT);
    let clients: Vec<_> = (0..4)
        .map(|client| {
            let mut connection = runtime.connect();
            std::thread::spawn(move || {
                let mut sent = Vec::new();
                for round in 0..100 {
                    // A goal where a resting arm is, with nothing to hold: reached within a step, if it is let.
                    let here = json!({"x": 2, "y": 0, "epsilon": 4, "success_hold": 0});
                    match (client + round) % 4 {
                        0 => drop(connection.call(CANCEL, json!({}))),
                        1 if round % 8 == 1 => drop(connection.ask("/arm_sim/reset", json!({}))),
                        2 => sent.push(send_goal(&mut connection, json!({"x": 1, "y": 1}))),
                        _ => sent.push(send_goal(&mut connection, here)),
                    }
                }
                sent
            })
        })
        .collect();
    // Who does not read for a second misses results.
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let reading = std::thread::spawn(move || {
        while let Err(std::sync::mpsc::TryRecvError::Empty) = stopped.try_recv() {
            listener.settle();
        }
        listener
    });
    let mut sent: Vec<String> = clients
        .into_iter()
        .flat_map(|client| client.join().unwrap())
        .collect();
    drop(stop);
    let mut listener = reading.join().unwrap();
    listener.call(CANCEL, json!({}));
    listener.settle();
    let mut ended: Vec<String> = listener
        .kept
        .iter()
        .filter(|frame| frame["topic"] == RESULT)
        .map(|frame| frame["msg"]["goal_id"].as_str().unwrap().to_owned())
        .collect();
    // The listener hears goals end in the order in which they were accepted.
    let number = |id: &String| id["goal-".len()..].parse::<u64>().unwrap();
    assert!(ended.is_sorted_by_key(number));
    sent.sort_by_key(number);
    ended.sort_by_key(number);
    assert_eq!(ended, sent);
}
