//! `/arm_sim/pause` and `/arm_sim/reset` from outside.

use std::time::Instant;

use crate::arm::{is_near, numbers, send_trajectory, stamp, state, state_where, ticks, trajectory};
use crate::common::Runtime;
use serde_json::{Value, json};

const PAUSE: &str = "/arm_sim/pause";
const RESET: &str = "/arm_sim/reset";

#[test]
fn the_arm_runs_until_it_is_paused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (request, paused) in [
        (json!({}), false),
        (json!({"data": true}), true),
        (json!({}), true),
        (Value::Null, true),
        (json!({"data": true}), true),
        (json!([false]), false),
        (json!({"data": false}), false),
        (json!([]), false),
    ] {
        assert_eq!(client.ask(PAUSE, request), json!({"data": paused}));
    }
}

#[test]
fn only_a_boolean_pauses() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for data in [
        json!(1),
        json!(0),
        json!(null),
        json!("true"),
        json!([]),
        json!({}),
        json!(1.0),
    ] {
        for paused in [false, true] {
            client.ask(PAUSE, json!({"data": paused}));
            let response = client.call(PAUSE, json!({"data": data}));
            assert_eq!(response["result"], false, "{data}");
            assert_eq!(response["values"], json!({"data": paused}), "{data}");
            assert!(response["status"].as_str().unwrap().contains("data"));
        }
    }
}

#[test]
fn while_paused_the_state_is_frozen_and_still_published() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    state_where(&mut client, "a moving arm", |state| stamp(state) > 0.3);
    client.ask(PAUSE, json!({"data": true}));
    let frozen = client.message("/joint_states");
    assert!(
        numbers(&frozen["velocity"])
            .iter()
            .any(|velocity| velocity.abs() > 0.1)
    );
    for _ in 0..60 {
        assert_eq!(client.message("/joint_states"), frozen, "exactly the same");
    }
}

#[test]
fn while_paused_every_other_service_answers_and_takes_effect() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask(PAUSE, json!({"data": true}));
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "euler", "timestep": 0.01}),
    );
    client.ask("/arm_sim/set_params", json!({"gravity": 1}));
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/pid_controller/set_gains", json!({"kp": [1, 1]}));
    client.ask(
        "/arm_sim/integration_step",
        json!({"function": "t", "x0": 0, "dt": 1, "steps": 1, "integrator": "rk4"}),
    );
    client.ask(RESET, json!({}));
    assert_eq!(
        client.ask("/arm_sim/set_integrator", json!({})),
        json!({"method": "euler", "timestep": 0.01})
    );
    assert_eq!(client.ask("/arm_sim/set_params", json!({}))["gravity"], 1.0);
    assert_eq!(
        client.ask("/pid_controller/enable", json!({})),
        json!({"data": true})
    );
    assert_eq!(
        client.ask("/pid_controller/set_gains", json!({}))["kp"],
        json!([1.0, 1.0])
    );
    assert_eq!(client.ask(PAUSE, json!({})), json!({"data": true}));
}

#[test]
fn a_resumed_arm_goes_on_from_where_it_was_and_makes_nothing_up() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask(PAUSE, json!({"data": true}));
    let frozen = client.message("/joint_states");
    ticks(&mut client, 60);
    let resumed = Instant::now();
    client.ask(PAUSE, json!({"data": false}));
    let mut last = stamp(&frozen);
    for _ in 0..30 {
        let now = stamp(&client.message("/joint_states"));
        assert!(now >= last, "time goes back from {last} to {now}");
        last = now;
    }
    // Simulation time since the resume can't exceed wall time since just before it.
    let wall = resumed.elapsed().as_secs_f64();
    let simulated = last - stamp(&frozen);
    assert!(simulated <= wall && simulated > 0.0, "{simulated} {wall}");
}

#[test]
fn a_reset_gives_the_starting_pose_at_rest() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        client.subscribe("/joint_states");
        state_where(&mut client, "a moving arm", |state| stamp(state) > 0.3);
        let zeros = vec![0.0; links];
        for request in [json!({}), Value::Null, json!([]), json!({"data": 1})] {
            let values = client.ask(RESET, request);
            assert_eq!(values, json!({"position": zeros, "velocity": zeros}));
        }
        let after = client.message("/joint_states");
        assert!(stamp(&after) < 0.3, "{after}");
    }
}

#[test]
fn a_reset_with_arguments_that_are_refused_is_none() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    state_where(&mut client, "a moving arm", |state| stamp(state) > 0.3);
    client.ask(PAUSE, json!({"data": true}));
    let frozen = client.message("/joint_states");
    let response = client.call(RESET, json!([1]));
    assert_eq!(response["result"], false);
    assert!(response["status"].as_str().unwrap().contains("args"));
    assert_eq!(
        response["values"]["position"], frozen["position"],
        "the pose as it is"
    );
    assert_eq!(client.message("/joint_states"), frozen);
}

#[test]
fn a_reset_while_paused_shows_zeros_and_stays_paused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    send_trajectory(&mut client, &trajectory(&[1.0, 1.0]));
    state_where(&mut client, "a moving arm", |state| {
        numbers(&state["position"])[0] > 0.2
    });
    client.ask(PAUSE, json!({"data": true}));
    assert!(numbers(&client.message("/joint_states")["effort"])[0].abs() > 0.0);
    client.ask(RESET, json!({}));
    for _ in 0..5 {
        let state = client.message("/joint_states");
        assert_eq!(stamp(&state), 0.0);
        for field in ["position", "velocity", "effort"] {
            assert_eq!(numbers(&state[field]), [0.0; 2], "{field}");
        }
    }
    assert_eq!(
        client.ask("/pid_controller/enable", json!({})),
        json!({"data": true})
    );
}

#[test]
fn a_reset_takes_the_setpoint_back_with_the_arm() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    send_trajectory(&mut client, &trajectory(&[1.5, -1.0]));
    state_where(&mut client, "an arm near its setpoint", |state| {
        is_near(state, &[1.5, -1.0], 0.2)
    });
    client.ask(RESET, json!({}));
    // With the old setpoint the arm would be up there again within a second.
    for _ in 0..90 {
        let state = client.message("/joint_states");
        assert!(is_near(&state, &[0.0, 0.0], 0.2), "{state}");
    }
    state_where(&mut client, "an arm held at home", |state| {
        is_near(state, &[0.0, 0.0], 0.01)
    });
}

#[test]
fn a_reset_keeps_every_setting() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "verlet", "timestep": 0.002}),
    );
    client.ask(
        "/arm_sim/set_params",
        json!({"gravity": 3.5, "masses": [2, 3], "lengths": [0.5, 0.25]}),
    );
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [10, 11], "ki": [12, 13], "kd": [14, 15]}),
    );
    client.ask("/pid_controller/enable", json!({"data": true}));
    let services = [
        "/arm_sim/set_integrator",
        "/arm_sim/set_params",
        PAUSE,
        "/pid_controller/enable",
        "/pid_controller/set_gains",
    ];
    let before = services.map(|service| client.ask(service, json!({})));
    client.ask(RESET, json!({}));
    assert_eq!(
        services.map(|service| client.ask(service, json!({}))),
        before
    );
}

#[test]
fn settings_outlive_the_client_that_made_them() {
    let runtime = Runtime::start();
    let mut first = runtime.connect();
    first.ask(PAUSE, json!({"data": true}));
    drop(first);
    let mut second = runtime.connect();
    assert_eq!(second.ask(PAUSE, json!({})), json!({"data": true}));
    second.subscribe("/joint_states");
    assert_eq!(state(&mut second), state(&mut second));
}
