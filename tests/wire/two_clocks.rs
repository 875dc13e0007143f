//! The control period, the state that is set, efforts of clients: by steps of a paused arm, and what is refused.
//!
//! **Invariant:** what the arm does is compared bit for bit with the offline stepper; no test looks at the wall clock.

use crate::common::{Client, Runtime};
use pendularm::math::arm::{Arm, State};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation};
use serde_json::{Value, json};

const PERIOD: &str = "/pid_controller/set_period";
const STATE: &str = "/arm_sim/set_state";
const STEP: &str = "/arm_sim/step";
const COMMANDS: &str = "/effort_controller/commands";

fn paused() -> (Runtime, Client, Simulation<2>) {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/reset", json!({}));
    let offline = Simulation::new(Arm::default(), Gains::default());
    (runtime, client, offline)
}

/// The answer of a step of a simulation.
fn stands(steps: u64, simulation: &Simulation<2>) -> Value {
    let State { position, velocity } = simulation.state();
    json!({"steps": steps, "time": simulation.time(), "position": position, "velocity": velocity,
        "effort": simulation.effort()})
}

#[track_caller]
fn step_both(client: &mut Client, offline: &mut Simulation<2>, steps: u64) {
    offline.advance(steps);
    assert_eq!(
        client.ask(STEP, json!({"steps": steps})),
        stands(steps, offline)
    );
}

#[test]
fn the_law_runs_once_a_period_and_a_timestep_keeps_the_period_that_was_asked_for() {
    let (_runtime, mut client, mut offline) = paused();
    let answer = |period: f64, effective: f64, delay: bool| json!({"period": period, "effective_period": effective, "delay": delay});
    assert_eq!(client.ask(PERIOD, json!({})), answer(0.0, 1e-3, false));
    assert_eq!(
        client.ask(PERIOD, json!({"period": 0.01})),
        answer(0.01, 10.0 * 1e-3, false)
    );
    client.ask("/pid_controller/enable", json!({"data": true}));
    offline.set_control_period(ControlPeriod {
        period: 0.01,
        delay: false,
    });
    offline.enable(true);
    step_both(&mut client, &mut offline, 17);
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.003}));
    offline.set_timestep(0.003);
    assert_eq!(
        client.ask(PERIOD, json!({})),
        answer(0.01, 3.0 * 0.003, false)
    );
    step_both(&mut client, &mut offline, 10);
    assert_eq!(
        client.ask(PERIOD, json!({"delay": true})),
        answer(0.01, 3.0 * 0.003, true)
    );
    offline.set_control_period(ControlPeriod {
        period: 0.01,
        delay: true,
    });
    step_both(&mut client, &mut offline, 10);
    // Neither a reset nor the controller's switch sets it back.
    for service in ["/arm_sim/reset", "/pid_controller/enable"] {
        client.ask(
            service,
            if service.ends_with("reset") {
                json!({})
            } else {
                json!({"data": false})
            },
        );
        assert_eq!(
            client.ask(PERIOD, json!({})),
            answer(0.01, 3.0 * 0.003, true)
        );
    }
}

#[test]
fn the_control_period_is_a_parameter_of_the_arm() {
    let (_runtime, mut client, _) = paused();
    let set = json!({"name": "/arm_sim:control_period", "value": "0.02"});
    client.ask("/rosapi/set_param", set);
    assert_eq!(client.ask(PERIOD, json!({}))["period"], 0.02);
    let got = client.ask(
        "/rosapi/get_param",
        json!({"name": "/arm_sim:control_period"}),
    );
    assert_eq!(got["value"], "0.02");
    let refused = client.ask(
        "/rosapi/set_param",
        json!({"name": "control_period", "value": "-1"}),
    );
    assert_eq!(refused["successful"], false);
    assert!(
        refused["reason"]
            .as_str()
            .unwrap()
            .contains("control_period"),
        "{refused}"
    );
}

#[test]
fn a_state_is_set_field_by_field_and_clock_setpoint_and_integral_stay() {
    let (_runtime, mut client, mut offline) = paused();
    client.ask("/pid_controller/enable", json!({"data": true}));
    offline.enable(true);
    step_both(&mut client, &mut offline, 50);
    let velocity = offline.state().velocity;
    let answer = client.ask(STATE, json!({"position": [0.4, 0.8]}));
    assert_eq!(
        answer,
        json!({"position": [0.4, 0.8], "velocity": velocity})
    );
    offline.set_state(State {
        position: [0.4, 0.8],
        velocity,
    });
    step_both(&mut client, &mut offline, 50);
    let answer = client.call(STATE, json!({"position": [0.1], "velocity": [1.0, -2.0]}));
    assert_eq!(answer["result"], false);
    assert!(
        answer["status"].as_str().unwrap().starts_with("position "),
        "{answer}"
    );
    let position = offline.state().position;
    assert_eq!(
        answer["values"],
        json!({"position": position, "velocity": [1.0, -2.0]})
    );
    offline.set_state(State {
        position,
        velocity: [1.0, -2.0],
    });
    step_both(&mut client, &mut offline, 50);
    let asked = client.ask(STATE, json!({}));
    assert_eq!(asked["position"], json!(offline.state().position));
    step_both(&mut client, &mut offline, 50);
}

#[test]
fn another_state_ends_a_divergence_and_the_clock_goes_on() {
    let (_runtime, mut client, _) = paused();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/set_integrator", json!({"timestep": 1.0}));
    let ended = client.call(STEP, json!({"steps": 10_000}));
    assert_eq!(ended["result"], false, "{ended}");
    client.subscribe("/diagnostics");
    client.ask(
        STATE,
        json!({"position": [0.0, 0.0], "velocity": [0.0, 0.0]}),
    );
    let message = client.message("/diagnostics");
    assert_eq!(message["status"][0]["message"], "paused");
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.001}));
    let stepped = client.ask(STEP, json!({"steps": 1}));
    assert_eq!(
        stepped["time"],
        ended["values"]["time"].as_f64().unwrap() + 0.001
    );
}

/// A client that closes the loop itself, with the product's own law: the same arm.
#[test]
fn steps_with_an_effort_are_a_loop_of_the_clients_own() {
    let (_runtime, mut client, mut offline) = paused();
    let (kp, kd, goal) = ([300.0, 80.0], [60.0, 15.0], [0.4, 0.8]);
    let mut state = client.ask(STATE, json!({}));
    for _ in 0..100 {
        let number = |name: &str, i: usize| state[name][i].as_f64().unwrap();
        let effort: [f64; 2] = std::array::from_fn(|i| {
            kp[i] * (goal[i] - number("position", i)) - kd[i] * number("velocity", i)
        });
        offline.drive(Some(effort));
        offline.advance(10);
        offline.drive(None);
        state = client.ask(STEP, json!({"steps": 10, "effort": effort}));
        assert_eq!(state, stands(10, &offline));
        assert_eq!(state["effort"], json!(effort));
    }
    // The controller goes on where it stood.
    client.ask("/pid_controller/enable", json!({"data": true}));
    offline.enable(true);
    offline.set_setpoint(Setpoint::default());
    step_both(&mut client, &mut offline, 20);
    let integral = *offline.pid().integral();
    offline.drive(Some([1.0, 2.0]));
    offline.advance(2500);
    offline.drive(None);
    let stepped = client.ask(STEP, json!({"steps": 2500, "effort": [1.0, 2.0]}));
    assert_eq!(stepped, stands(2500, &offline));
    assert_eq!(*offline.pid().integral(), integral);
    step_both(&mut client, &mut offline, 20);
    for bad in [
        json!([1.0]),
        json!([1.0, "2"]),
        json!(1.0),
        json!([1.0, 2.0, 3.0]),
    ] {
        let answer = client.call(STEP, json!({"steps": 1, "effort": bad}));
        assert_eq!(answer["result"], false);
        assert!(
            answer["status"].as_str().unwrap().contains("effort"),
            "{answer}"
        );
    }
    step_both(&mut client, &mut offline, 1);
}

fn command(client: &mut Client, effort: &Value) {
    client.send(&json!({"op": "publish", "topic": COMMANDS,
        "msg": {"layout": {"dim": [], "data_offset": 0}, "data": effort}}));
}

#[test]
fn commands_are_applied_until_a_reset_a_switch_or_the_end_of_their_client() {
    let (runtime, mut client, mut offline) = paused();
    command(&mut client, &json!([3.0, -1.0]));
    offline.set_command([3.0, -1.0]);
    step_both(&mut client, &mut offline, 30);
    client.ask("/arm_sim/reset", json!({}));
    offline.reset();
    step_both(&mut client, &mut offline, 1);
    // A switch of what is off already ends a command too.
    for switches in [&[true, false][..], &[false]] {
        command(&mut client, &json!([3.0, -1.0]));
        offline.set_command([3.0, -1.0]);
        step_both(&mut client, &mut offline, 3);
        for on in switches {
            client.ask("/pid_controller/enable", json!({"data": on}));
            offline.enable(*on);
        }
        step_both(&mut client, &mut offline, 3);
    }
    let mut other = runtime.connect();
    command(&mut other, &json!([5.0, 0.0]));
    other.settle();
    let effort = client.ask(STEP, json!({"steps": 1}))["effort"].clone();
    assert_eq!(effort, json!([5.0, 0.0]));
    drop(other);
    let is_over =
        |client: &mut Client| client.ask(STEP, json!({"steps": 1}))["effort"] == json!([0.0, 0.0]);
    assert!((0..1000).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(10));
        is_over(&mut client)
    }));
}

#[test]
fn commands_are_refused_by_field_and_while_the_controller_is_on() {
    let (_runtime, mut client, _) = paused();
    for (bad, named) in [
        (json!([1.0]), "data"),
        (json!("x"), "data"),
        (json!(null), "data"),
        (json!([1.0, null]), "data[1]"),
    ] {
        command(&mut client, &bad);
        let status = client.status();
        assert_eq!(status["level"], "error");
        let msg = status["msg"].as_str().unwrap();
        assert!(msg.starts_with(COMMANDS) && msg.contains(named), "{msg}");
    }
    client.ask("/pid_controller/enable", json!({"data": true}));
    command(&mut client, &json!([1.0, 1.0]));
    let status = client.status();
    assert!(
        status["msg"]
            .as_str()
            .unwrap()
            .contains("/pid_controller/enable"),
        "{status}"
    );
    client.ask("/pid_controller/enable", json!({"data": false}));
    assert_eq!(
        client.ask(STEP, json!({"steps": 1}))["effort"],
        json!([0.0, 0.0])
    );
}
