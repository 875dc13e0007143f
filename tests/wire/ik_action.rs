//! Goals of several clients at the same time, on threads of their own.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";
const RESULT: &str = "/ik_action/result";

fn send_goal(client: &mut Client, args: Value) -> String {
    let values = client.ask(SEND, args);
    values["goal_id"].as_str().unwrap().to_owned()
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
    // A client that does not read for a second misses results.
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
