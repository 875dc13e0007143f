//! Single steps of a paused arm, and pushes: their effects, and their refusals in which words.
//!
//! **Invariant:** what the arm does is compared bit for bit with the offline stepper; no test looks at the wall clock.

use crate::common::{Client, Runtime};
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use serde_json::{Value, json};

const STEP: &str = "/arm_sim/step";
const DISTURB: &str = "/arm_sim/disturb";

/// A paused arm at time 0, and the same offline.
fn paused() -> (Runtime, Client, Simulation<2>) {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/reset", json!({}));
    (
        runtime,
        client,
        Simulation::new(Arm::default(), Gains::default()),
    )
}

/// The arm's state as it is published.
fn joint_state(client: &mut Client) -> Value {
    client.subscribe("/joint_states");
    let state = client.message("/joint_states");
    client.send(&json!({"op": "unsubscribe", "topic": "/joint_states"}));
    client.settle();
    client.kept.clear();
    state
}

#[track_caller]
fn assert_same(client: &mut Client, offline: &Simulation<2>) {
    let state = joint_state(client);
    assert_eq!(state["position"], json!(offline.state().position));
    assert_eq!(state["velocity"], json!(offline.state().velocity));
    assert_eq!(state["effort"], json!(offline.effort()));
}

#[test]
fn a_paused_arm_takes_exactly_the_steps_that_are_asked_for() {
    let (_runtime, mut client, mut offline) = paused();
    for steps in [1, 1, 250, 10_000] {
        let values = client.ask(STEP, json!({"steps": steps}));
        offline.advance(steps);
        let (state, effort) = (offline.state(), offline.effort());
        assert_eq!(
            values,
            json!({"steps": steps, "time": offline.time(), "position": state.position,
                "velocity": state.velocity, "effort": effort})
        );
    }
    assert_same(&mut client, &offline);
}

/// Steps are taken in slices; later requests of the same client wait all the same, whoever else steps meanwhile.
#[test]
fn what_a_client_sends_behind_its_steps_takes_effect_behind_them() {
    let (runtime, mut client, mut offline) = paused();
    let mut frames = String::new();
    for length in [1.1, 1.2, 1.3, 1.4] {
        for (service, args) in [
            (STEP, json!({"steps": 5000})),
            ("/arm_sim/set_params", json!({"lengths": [length, 1]})),
        ] {
            let call = json!({"op": "call_service", "service": service, "args": args});
            frames += &format!("{call}\n");
        }
        offline.advance(5000);
        offline.set_arm(Arm::new([length, 1.0], *offline.arm().masses(), 9.81).unwrap());
    }
    client.send_bytes(frames.as_bytes());
    for _ in 0..8 {
        assert_eq!(client.receive()["result"], true);
    }
    assert_same(&mut client, &offline);
    let mut others: Vec<Client> = (0..4).map(|_| runtime.connect()).collect();
    for other in &mut others {
        other.send(&json!({"op": "call_service", "service": STEP, "args": {"steps": 10_000}}));
    }
    client.ask(STEP, json!({"steps": 1}));
    for other in &mut others {
        assert_eq!(other.receive()["values"]["steps"], 10_000);
    }
    offline.advance(40_001);
    assert_same(&mut client, &offline);
}

#[test]
fn steps_are_refused_while_the_arm_runs() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let response = client.call(STEP, json!({"steps": 1}));
    assert_eq!(response["values"], json!({}));
    assert_eq!(response["result"], false);
    assert_eq!(
        response["status"],
        "steps can be taken only while the arm is paused"
    );
}

/// Euler at one-second steps: the free arm falls ever faster, and its energy overflows within some hundred steps.
#[test]
fn a_divergence_ends_the_steps_and_refuses_more_until_a_reset() {
    let (_runtime, mut client, mut offline) = paused();
    let euler = json!({"method": "euler", "timestep": 1.0});
    client.ask("/arm_sim/set_integrator", euler);
    offline.set_method(pendularm::math::integrator::Method::Euler);
    offline.set_timestep(1.0);
    let taken = offline.advance(10_000);
    assert!(offline.divergence().is_some());

    let response = client.call(STEP, json!({"steps": 10_000}));
    assert_eq!(response["result"], false);
    assert_eq!(response["values"]["steps"], taken);
    assert_eq!(response["values"]["time"], offline.time());
    assert_eq!(
        response["status"],
        "steps ended early: the simulation has diverged"
    );
    let push = json!({"effort": [1, 1], "duration": 1});
    for (service, args) in [(STEP, json!({"steps": 1})), (DISTURB, push)] {
        let response = client.call(service, args);
        assert_eq!(response["values"], json!({}));
        let refusal = response["status"].as_str().unwrap();
        assert!(
            refusal.contains("diverged") && refusal.contains("/arm_sim/reset"),
            "{refusal}"
        );
    }
    client.ask("/arm_sim/reset", json!({}));
    client.ask(STEP, json!({"steps": 1}));
}

#[test]
fn a_push_is_in_the_effort_of_its_steps_and_of_no_other() {
    let (_runtime, mut client, mut offline) = paused();
    let push = json!({"effort": [5.0, -2.0], "duration": 0.003});
    assert_eq!(client.ask(DISTURB, push.clone()), push);
    offline.disturb([5.0, -2.0], 0.003);
    // Three steps of 1 ms begin within 3 ms.
    client.ask(STEP, json!({"steps": 3}));
    offline.advance(3);
    assert_eq!(joint_state(&mut client)["effort"], json!([5.0, -2.0]));
    assert_same(&mut client, &offline);
    client.ask(STEP, json!({"steps": 1}));
    offline.advance(1);
    assert_eq!(joint_state(&mut client)["effort"], json!([0.0, 0.0]));
    assert_same(&mut client, &offline);
}
