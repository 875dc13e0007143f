//! `/clock` and `/diagnostics` from outside.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::arm::{stamp, time};
use crate::common::{Client, PATIENCE, Runtime};
use crate::diagnostics::{arm_status, number, status, text};
use serde_json::{Value, json};

/// The contract's, then ours.
const KEYS: [&str; 13] = [
    "state",
    "sim_time",
    "real_time_factor",
    "steps_per_second",
    "energy",
    "energy_drift",
    "max_step_time",
    "control_period",
    "control_period_limit",
    "timestep_limit",
    "timestep_limit_motion",
    "setpoint",
    "warning",
];

/// The keys that docs/protocol.md has for a status.
fn documented(name: &str) -> Vec<String> {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/protocol.md");
    let paper = std::fs::read_to_string(paper).unwrap();
    let start = format!("| `{name}` | ");
    let row = paper.lines().find_map(|line| line.strip_prefix(&start));
    let codes = row.expect("a row of its own").split('`').skip(1).step_by(2);
    codes.map(str::to_owned).collect()
}

#[test]
fn the_clock_is_the_time_in_the_joint_states_at_the_same_rate() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/clock");
    client.subscribe("/joint_states");
    client.ask("/arm_sim/pause", json!({"data": true}));
    let state = client.message("/joint_states");
    let clock = client.message("/clock");
    assert_eq!(clock, json!({"clock": state["header"]["stamp"]}));
    client.ask("/arm_sim/pause", json!({"data": false}));
    client.kept.clear();
    let times: Vec<f64> = (0..30)
        .map(|_| time(&client.message("/clock")["clock"]))
        .collect();
    // The clock is the only other topic.
    let states: Vec<f64> = client
        .kept
        .iter()
        .map(|frame| stamp(&frame["msg"]))
        .collect();
    assert!(times.len().abs_diff(states.len()) <= 1);
    assert!(
        times
            .iter()
            .all(|time| states.contains(time) || time > states.last().unwrap())
    );
}

#[test]
fn diagnostics_have_the_documented_statuses_and_keys_once_a_second() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let began = Instant::now();
    client.subscribe("/diagnostics");
    let first = client.message("/diagnostics");
    assert_eq!(first["header"]["frame_id"], "world");
    assert_eq!(first["status"].as_array().unwrap().len(), 2);
    let arm = status(&first, "arm_sim");
    assert_eq!(arm["message"], "running");
    let keys: Vec<&str> = arm["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| entry["key"].as_str().unwrap())
        .collect();
    assert_eq!(keys, KEYS);
    assert_eq!(documented("arm_sim"), KEYS);
    assert_eq!(text(arm, "state"), "running");
    for key in &KEYS[1..8] {
        assert!(number(arm, key).is_finite(), "{key}");
    }
    assert_eq!(text(arm, "warning"), "");
    let gateway = status(&first, "gateway");
    assert_eq!(gateway["level"], 0);
    for key in documented("gateway") {
        text(gateway, &key);
    }
    assert_eq!(number(gateway, "connections"), 1.0);
    assert_eq!(number(gateway, "messages_dropped"), 0.0);
    client.subscribe("/joint_states");
    client.message("/diagnostics");
    client.kept.clear();
    client.message("/diagnostics");
    client.message("/diagnostics");
    // A busy machine skips ticks, and makes none up: every sixtieth has a message, however long they take.
    assert_eq!(client.kept.len(), 2 * 60, "states in two periods");
    let took = began.elapsed();
    assert!(took >= Duration::from_millis(1900), "two in {took:?}");
}

#[test]
fn rates_are_those_of_wall_time() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    arm_status(&mut client);
    // An idle machine gives 1 and 1000. One that stands still loses any part of a second, of which the arm makes up
    // 250 ms: a message may say less of a right arm, never much more, and two soon say enough.
    let deadline = Instant::now() + PATIENCE;
    let mut enough = 0;
    while enough < 2 {
        let arm = arm_status(&mut client);
        let (factor, rate) = (
            number(&arm, "real_time_factor"),
            number(&arm, "steps_per_second"),
        );
        assert!((0.0..1.3).contains(&factor), "{arm}");
        enough += usize::from(factor >= 0.5);
        assert!(Instant::now() < deadline, "it is slow: {arm}");
        assert!(
            (rate - 1000.0 * factor).abs() < 1.0,
            "steps of a millisecond: {arm}"
        );
        let step = number(&arm, "max_step_time");
        assert!(step > 0.0 && step < 0.1, "{arm}");
    }
}

#[test]
fn every_change_of_state_is_told_at_once_and_nothing_else_is() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.subscribe("/diagnostics");
    let paused = arm_status(&mut client);
    assert_eq!(
        (&paused["level"], &paused["message"]),
        (&json!(0), &json!("paused"))
    );
    assert_eq!(text(&paused, "state"), "paused");
    for (data, state) in [(false, "running"), (true, "paused"), (false, "running")] {
        client.kept.clear();
        client.ask("/arm_sim/pause", json!({"data": data}));
        client.ask("/arm_sim/pause", json!({"data": data}));
        // Before the response. The messages of the seconds come too: one at most from after the change.
        let told = client.kept.iter().filter(|frame| {
            frame["topic"] == "/diagnostics"
                && text(status(&frame["msg"], "arm_sim"), "state") == state
        });
        let told: Vec<&Value> = told.collect();
        assert!((1..=2).contains(&told.len()), "{:?}", client.kept);
    }
}

#[test]
fn a_paused_arm_makes_no_steps() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.subscribe("/diagnostics");
    arm_status(&mut client);
    let arm = arm_status(&mut client);
    assert_eq!(number(&arm, "real_time_factor"), 0.0);
    assert_eq!(number(&arm, "steps_per_second"), 0.0);
    assert_eq!(number(&arm, "max_step_time"), 0.0);
}

/// The default arm on its side has no energy and, swinging freely by rk4 at 1 ms, keeps that for a second within 1e-6 J.
/// Forward Euler at 10 ms gains a good part of a joule.
#[test]
fn the_setpoint_is_told_to_whoever_comes_late() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    crate::arm::send_trajectory(&mut client, &crate::arm::trajectory(&[0.25, -1.5]));
    client.subscribe("/diagnostics");
    let told = (0..5).map(|_| text(&arm_status(&mut client), "setpoint").to_owned());
    assert!(told.into_iter().any(|setpoint| setpoint == "[0.25, -1.5]"));
    client.ask("/arm_sim/reset", json!({}));
    let told = (0..5).map(|_| text(&arm_status(&mut client), "setpoint").to_owned());
    assert!(told.into_iter().any(|setpoint| setpoint == "[0.0, 0.0]"));
}

#[test]
fn the_energy_drift_counts_from_reset_parameters_and_switch() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    client.subscribe("/clock");
    client.ask("/arm_sim/reset", json!({}));
    let free = arm_status(&mut client);
    assert!(number(&free, "energy").abs() < 1e-6, "{free}");
    assert!(number(&free, "energy_drift").abs() < 1e-6, "{free}");

    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "euler", "timestep": 0.01}),
    );
    arm_status(&mut client);
    let gained = arm_status(&mut client);
    assert!(number(&gained, "energy_drift") > 0.01, "{gained}");
    assert!(
        (number(&gained, "energy_drift") - number(&gained, "energy")).abs() < 1e-6,
        "from 0: {gained}"
    );

    // Frozen, so that nothing happens between the change and the message.
    client.ask("/arm_sim/pause", json!({"data": true}));
    let frozen = arm_status(&mut client);
    assert!(
        number(&frozen, "energy_drift") > 0.01,
        "a pause is no change: {frozen}"
    );
    client.ask("/arm_sim/set_params", json!({"gravity": 9.81}));
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.02}));
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [1, 1], "ki": [0, 0], "kd": [0, 0]}),
    );
    client.ask("/pid_controller/enable", json!({"data": false}));
    client.kept.clear();
    let same = arm_status(&mut client);
    assert_eq!(
        number(&same, "energy_drift"),
        number(&frozen, "energy_drift"),
        "nor is what changes nothing"
    );
    for (service, args) in [
        ("/arm_sim/set_params", json!({"gravity": 5})),
        ("/pid_controller/enable", json!({"data": true})),
        ("/pid_controller/enable", json!({"data": false})),
        ("/arm_sim/reset", json!({})),
    ] {
        client.ask("/arm_sim/pause", json!({"data": false}));
        swing(&mut client, 0.3);
        client.ask("/arm_sim/pause", json!({"data": true}));
        client.ask(service, args);
        client.kept.clear();
        assert_eq!(
            number(&arm_status(&mut client), "energy_drift"),
            0.0,
            "{service}"
        );
    }
}

/// Waits until the arm's own clock has gone on by so much \[s\].
fn swing(client: &mut Client, passing: f64) {
    let now = |client: &mut Client| time(&client.message("/clock")["clock"]);
    client.kept.clear();
    let began = now(client);
    while now(client) < began + passing {}
}

/// No machine takes a step in a picosecond: the arm lags, says so, and goes on answering.
#[test]
fn an_arm_that_can_not_follow_wall_time_warns() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    client.ask("/arm_sim/set_integrator", json!({"timestep": 1e-12}));
    arm_status(&mut client);
    let lagging = arm_status(&mut client);
    assert_eq!(
        (&lagging["level"], &lagging["message"]),
        (&json!(1), &json!("running"))
    );
    assert!(number(&lagging, "real_time_factor") < 0.01, "{lagging}");
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.001}));
    client.kept.clear();
    arm_status(&mut client);
    assert_eq!(arm_status(&mut client)["level"], 0);
}
