//! Computations on their own threads while the arm runs.

use std::time::Duration;

use crate::common::{Client, PATIENCE, Runtime};
use serde_json::{Value, json};

/// A call with seconds of work and a small answer: a sum of 2001 terms (4001 nodes), 4 times in each of 100,000 steps.
/// A test that sends it does not wait for its end.
fn send_heavy(client: &mut Client) {
    let args = json!({"function": vec!["t"; 2001].join("+"), "x0": 0, "dt": 1e-3, "steps": 100_000,
        "integrator": "rk4"});
    client
        .send(&json!({"op": "call_service", "service": "/arm_sim/integration_step", "args": args}));
}

/// A correct runtime may fail a try on a busy machine, and a wrong one never passes.
#[test]
fn the_arm_and_its_messages_continue_during_a_computation() {
    let attempt = || {
        let runtime = Runtime::start();
        let mut busy: Vec<Client> = (0..3).map(|_| runtime.connect()).collect();
        for client in &mut busy {
            send_heavy(client);
            client.settle();
        }
        let mut watcher = runtime.connect();
        watcher.subscribe("/joint_states");
        let seen = watcher.receive_for(Duration::from_secs(2));
        let time = |frame: Option<&Value>| {
            let stamp = &frame.expect("a message")["msg"]["header"]["stamp"];
            stamp["sec"].as_f64().unwrap() + stamp["nanosec"].as_f64().unwrap() / 1e9
        };
        // 120 messages and 2 s on an idle machine.
        (seen.len(), time(seen.last()) - time(seen.first()))
    };
    let passes = |(messages, simulated)| messages > 20 && simulated > 0.7;
    assert!((0..3).any(|_| passes(attempt())), "in 2 s");
}

/// A hundred thousand samples of a million steps: answered in one frame, while others are served.
#[test]
fn the_largest_answers_are_given_while_others_are_served() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    client.send(
        &json!({"op": "call_service", "service": "/study/rollout", "id": "big",
        "args": {"duration": 100, "timestep": 1e-4, "integrator": "euler", "samples": 100_000}}),
    );
    // Later frames of the same connection are handled meanwhile.
    client.settle();
    let short = other.ask("/study/rollout", json!({"duration": 0.01}));
    assert_eq!(short["times"].as_array().unwrap().len(), 11);
    // Tens of megabytes to compute, write and parse, while other tests run.
    client.set_patience(6 * PATIENCE);
    let response = client.receive_where("the big answer", |frame| frame["id"] == "big");
    for key in ["times", "positions", "velocities", "efforts", "energy"] {
        let values = response["values"][key].as_array().unwrap();
        assert_eq!(values.len(), 100_000, "{key}");
    }
}
