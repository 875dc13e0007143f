//! `/diagnostics` against wall time and against its documentation.

use std::path::Path;

use crate::common::Runtime;
use crate::diagnostics::{arm_status, number, status, text};
use serde_json::json;

/// The contract's statuses, then the project's own.
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
fn diagnostics_have_the_documented_statuses_and_keys() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
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
}

/// A microsecond is at the edge of what a machine can follow. No machine takes a step in a picosecond: the arm lags,
/// reports it, and still answers.
#[test]
fn an_arm_that_can_not_follow_wall_time_warns_and_answers() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    for timestep in [1e-6, 1e-12, 1e-300] {
        client.ask("/arm_sim/set_integrator", json!({"timestep": timestep}));
        arm_status(&mut client);
        let status = arm_status(&mut client);
        let factor = number(&status, "real_time_factor");
        assert_eq!(status["message"], "running");
        match timestep {
            1e-6 => assert!(factor > 0.0, "{status}"),
            _ => assert!(factor < 0.01 && status["level"] == 1, "{status}"),
        }
        client.ask("/arm_sim/set_integrator", json!({"timestep": 0.001}));
        client.ask("/arm_sim/reset", json!({}));
        client.kept.clear();
        arm_status(&mut client);
        let status = arm_status(&mut client);
        assert_eq!(status["level"], 0, "{status}");
        assert!(number(&status, "sim_time") > 0.2, "{status}");
    }
}
