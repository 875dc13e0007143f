//! The controller from outside: off at first, on and off again, the integral, the offset, and the gravity load.

use crate::arm::{
    gravity_load, is_near, let_simulate, numbers, send_trajectory, stamp, state, state_where,
    ticks, trajectory,
};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const ENABLE: &str = "/pid_controller/enable";

/// The load by the parameters that the runtime reports, at the positions of `state`.
fn load_at(client: &mut Client, state: &Value) -> Vec<f64> {
    let parameters = client.ask("/arm_sim/set_params", json!({}));
    gravity_load(
        &numbers(&parameters["lengths"]),
        &numbers(&parameters["masses"]),
        parameters["gravity"].as_f64().unwrap(),
        &numbers(&state["position"]),
    )
}

fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |largest: f64, value| largest.max(value.abs()))
}

#[test]
fn a_fresh_runtime_lets_the_arm_swing_without_effort() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        assert_eq!(client.ask(ENABLE, json!({})), json!({"data": false}));
        client.subscribe("/joint_states");
        client.ask("/arm_sim/reset", json!({}));
        let mut fastest = vec![0.0_f64; links];
        for _ in 0..60 {
            let state = client.message("/joint_states");
            assert_eq!(numbers(&state["effort"]), vec![0.0; links]);
            for (fastest, velocity) in fastest.iter_mut().zip(numbers(&state["velocity"])) {
                *fastest = fastest.max(velocity.abs());
            }
        }
        // Every joint takes part: the first falls, and what hangs on it is left behind or thrown.
        assert!(fastest.iter().all(|&one| one > 0.5), "{fastest:?}");
    }
}

#[test]
fn a_setpoint_alone_moves_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask("/arm_sim/reset", json!({}));
    client.subscribe("/joint_states");
    send_trajectory(&mut client, &trajectory(&[1.0, 1.0]));
    let later = state_where(&mut client, "half a second", |state| stamp(state) > 0.5);
    assert_eq!(numbers(&later["position"]), [0.0; 2]);
    assert_eq!(numbers(&later["effort"]), [0.0; 2]);
}

#[test]
fn the_switch_is_a_boolean_and_a_query_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (request, on) in [
        (json!({"data": true}), true),
        (json!({}), true),
        (json!({"data": true}), true),
        (json!([]), true),
        (json!([false]), false),
        (Value::Null, false),
    ] {
        assert_eq!(client.ask(ENABLE, request), json!({"data": on}));
    }
    for data in [json!(1), json!(null), json!("true"), json!([true])] {
        let response = client.call(ENABLE, json!({"data": data}));
        assert_eq!(response["result"], false, "{data}");
        assert_eq!(response["values"], json!({"data": false}), "{data}");
        assert!(response["status"].as_str().unwrap().contains("data"));
    }
}

#[test]
fn until_a_trajectory_comes_the_arm_is_held_at_its_starting_pose() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    state_where(&mut client, "a fallen arm", |state| stamp(state) > 0.4);
    client.ask(ENABLE, json!({"data": true}));
    state_where(&mut client, "an arm at home", |state| {
        is_near(state, &[0.0, 0.0], 0.01)
    });
}

#[test]
fn every_setpoint_is_reached_in_four_seconds_and_kept() {
    use std::f64::consts::TAU;
    let cases: [(usize, &[f64]); 4] = [
        (2, &[0.3, -0.5]),
        (2, &[-TAU, TAU]),
        (3, &[0.5, 0.7, -1.0]),
        (3, &[TAU, -TAU, TAU]),
    ];
    std::thread::scope(|scope| {
        for (links, setpoint) in cases {
            scope.spawn(move || {
                let runtime = Runtime::with_links(links);
                let mut client = runtime.connect();
                client.subscribe("/joint_states");
                state_where(&mut client, "an arm in free swing", |state| {
                    stamp(state) > 1.0
                });
                client.ask(ENABLE, json!({"data": true}));
                send_trajectory(&mut client, &trajectory(setpoint));
                let sent = stamp(&state(&mut client));
                let arrived = state_where(&mut client, "four seconds", |state| {
                    stamp(state) > sent + 4.0
                });
                assert!(is_near(&arrived, setpoint, 0.02), "{arrived}");
                for _ in 0..60 {
                    let later = client.message("/joint_states");
                    assert!(is_near(&later, setpoint, 0.02), "{later}");
                }
            });
        }
    });
}

/// At rest the equation of motion is τ = G(q). G is computed here from the parameters that the runtime reports.
#[test]
fn ten_seconds_after_settling_the_effort_is_the_gravity_load() {
    let cases: [(usize, &[f64], Value); 3] = [
        (2, &[0.3, -0.5], json!({})),
        (3, &[0.6, -0.4, 0.9], json!({})),
        (
            2,
            &[2.0, 0.4],
            json!({"gravity": 3.7, "masses": [0.8, 1.4], "lengths": [1.2, 0.7]}),
        ),
    ];
    std::thread::scope(|scope| {
        for (links, setpoint, parameters) in cases {
            scope.spawn(move || {
                let runtime = Runtime::with_links(links);
                let mut client = runtime.connect();
                client.ask("/arm_sim/set_params", parameters);
                client.ask(ENABLE, json!({"data": true}));
                send_trajectory(&mut client, &trajectory(setpoint));
                client.subscribe("/joint_states");
                state_where(&mut client, "a settled arm", |state| {
                    is_near(state, setpoint, 0.02)
                });
                let_simulate(&mut client, 10.0);
                let rest = state(&mut client);
                let load = load_at(&mut client, &rest);
                for (effort, load_here) in numbers(&rest["effort"]).iter().zip(&load) {
                    let error = (effort - load_here).abs();
                    assert!(error < 0.01 * largest(&load), "{rest} {load:?}");
                }
            });
        }
    });
}

/// Without an integral nothing but `kp e` can carry the load, so at rest `kp (q* - q) = G(q)`: an offset that stays. With an
/// integral it goes.
#[test]
fn only_the_integral_closes_the_offset() {
    for (links, kp, kd) in [
        (2, json!([200, 60]), json!([60, 15])),
        (3, json!([400, 90, 30]), json!([120, 25, 5])),
    ] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        let none = vec![0.0; links];
        client.ask(
            "/pid_controller/set_gains",
            json!({"kp": kp, "kd": kd, "ki": none}),
        );
        client.ask(ENABLE, json!({"data": true}));
        let setpoint = [0.4, -0.3, 0.2];
        let setpoint = &setpoint[..links];
        send_trajectory(&mut client, &trajectory(setpoint));
        client.subscribe("/joint_states");
        let at_rest =
            |state: &Value| stamp(state) > 2.0 && largest(&numbers(&state["velocity"])) < 1e-4;
        let rest = state_where(&mut client, "an arm at rest", at_rest);
        let load = load_at(&mut client, &rest);
        for joint in 0..links {
            let offset = setpoint[joint] - numbers(&rest["position"])[joint];
            let proportional = numbers(&kp)[joint] * offset;
            // kd times what is left of the velocity is below 0.02 N m.
            assert!((proportional - load[joint]).abs() < 0.05, "{rest} {load:?}");
            assert!(offset.abs() > 0.01, "no offset at joint {joint}: {rest}");
        }
        let ki: Vec<f64> = numbers(&kp).iter().map(|kp| 2.0 * kp).collect();
        client.ask("/pid_controller/set_gains", json!({"ki": ki}));
        state_where(&mut client, "an arm at its setpoint", |state| {
            is_near(state, setpoint, 0.002)
        });
    }
}

#[test]
fn disabling_ends_the_effort_at_once_also_while_paused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    for paused in [false, true] {
        client.ask(ENABLE, json!({"data": true}));
        client.ask("/arm_sim/pause", json!({"data": false}));
        state_where(&mut client, "an effort", |state| {
            largest(&numbers(&state["effort"])) > 1.0
        });
        client.ask("/arm_sim/pause", json!({"data": paused}));
        let held = client.message("/joint_states");
        assert!(
            largest(&numbers(&held["effort"])) > 0.0,
            "pausing keeps the latest step's effort"
        );
        client.ask(ENABLE, json!({"data": false}));
        for _ in 0..3 {
            assert_eq!(
                numbers(&client.message("/joint_states")["effort"]),
                [0.0; 2]
            );
        }
    }
}

/// With `ki` alone the effort is `ki I`: it shows the integral. No gravity, and so little effort that the arm hardly moves.
fn integral_probe(client: &mut Client) {
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [0, 0], "ki": [1e-6, 1e-6], "kd": [0, 0]}),
    );
    client.subscribe("/joint_states");
    client.ask("/arm_sim/reset", json!({}));
    send_trajectory(client, &trajectory(&[1.0, -2.0]));
}

fn integral(client: &mut Client) -> Vec<f64> {
    numbers(&state(client)["effort"])
        .iter()
        .map(|effort| effort * 1e6)
        .collect()
}

#[test]
fn the_integral_starts_from_zero_when_the_controller_goes_on() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    integral_probe(&mut client);
    client.ask(ENABLE, json!({"data": true}));
    let_simulate(&mut client, 1.0);
    let long = integral(&mut client);
    assert!(
        long[0] > 0.5 && long[1] < -1.0,
        "errors of 1 and -2 rad for a second: {long:?}"
    );
    client.ask(ENABLE, json!({"data": false}));
    let_simulate(&mut client, 1.0);
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask(ENABLE, json!({"data": true}));
    client.ask("/arm_sim/step", json!({"steps": 1}));
    let fresh = integral(&mut client);
    assert!(
        fresh[0].abs() < 0.01 && fresh[1].abs() < 0.01,
        "a millisecond's after {long:?}: {fresh:?}"
    );
}

#[test]
fn enabling_what_is_on_keeps_the_integral() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    integral_probe(&mut client);
    client.ask(ENABLE, json!({"data": true}));
    let_simulate(&mut client, 1.0);
    let before = integral(&mut client);
    client.ask(ENABLE, json!({"data": true}));
    client.ask(ENABLE, json!({}));
    client.call(ENABLE, json!({"data": 0}));
    let after = integral(&mut client);
    assert!(
        after[0] >= before[0] && after[1] <= before[1],
        "{before:?} {after:?}"
    );
}

#[test]
fn the_integral_stands_still_while_the_arm_is_paused_or_the_controller_off() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    integral_probe(&mut client);
    client.ask(ENABLE, json!({"data": true}));
    let_simulate(&mut client, 0.3);
    client.ask("/arm_sim/pause", json!({"data": true}));
    let before = state(&mut client);
    ticks(&mut client, 60);
    client.ask("/arm_sim/pause", json!({"data": false}));
    let after = state(&mut client);
    // In an error of 1 rad the integral grows by a second per second of simulation, no more.
    let grown = (numbers(&after["effort"])[0] - numbers(&before["effort"])[0]) * 1e6;
    assert!(
        grown <= stamp(&after) - stamp(&before) + 1e-6,
        "{grown}: {before} {after}"
    );
}

#[test]
fn a_reset_zeroes_the_integral_and_leaves_the_controller_on() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    integral_probe(&mut client);
    client.ask(ENABLE, json!({"data": true}));
    let_simulate(&mut client, 1.0);
    assert!(integral(&mut client)[0] > 0.5);
    client.ask("/arm_sim/reset", json!({}));
    // The setpoint is where the arm is, so nothing grows again.
    assert_eq!(integral(&mut client), [0.0; 2]);
    assert_eq!(client.ask(ENABLE, json!({})), json!({"data": true}));
}
