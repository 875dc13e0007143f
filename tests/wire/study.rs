//! `/study/*`, the limit in `/diagnostics` and `/arm_sim/error_estimate`, from outside.

use crate::common::{Client, Runtime};
use crate::diagnostics::{arm_status, text};
use serde_json::{Value, json};

/// Answers that an independent check found wrong, asked of the program itself with the check's own numbers.
#[test]
fn the_answers_that_were_wrong_are_right() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // A limit belongs to its pose: a fresh arm is stretched, where the limit is the smallest of all.
    let limit = |values: &Value, name: &str| values[name].as_f64().unwrap();
    let fresh = client.ask("/study/stability", json!({}));
    assert!(
        (limit(&fresh, "timestep_limit_held") - 4.32e-3).abs() < 5e-6,
        "{fresh}"
    );
    let bent = client.ask("/study/stability", json!({"setpoint": [0.5, 0.8]}));
    assert!(
        (limit(&bent, "timestep_limit_held") - 8.21e-3).abs() < 5e-6,
        "{bent}"
    );
    assert!(
        (limit(&bent, "minimum_over_poses_held") - 4.32e-3).abs() < 5e-6,
        "{bent}"
    );
    // 223 ms were advised to the arm left to itself, which was lost after 11 s at 83 ms.
    let none = json!({"kp": [0, 0], "ki": [0, 0], "kd": [0, 0]});
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/reset", json!({}));
    let free = client.ask(
        "/study/stability",
        json!({"gains": none, "integrator": "verlet"}),
    );
    assert!(
        (0.02..0.083).contains(&limit(&free, "advised_timestep")),
        "{free}"
    );
    // An error of 1.34e-12 was answered, where 4.41e-12 was true; one ten times as small is not known.
    let mut swing = |timestep: f64| {
        let tiny = json!({"q0": [0.4, -0.3], "duration": 5, "integrator": "rk4", "timestep": timestep, "reference": true, "samples": 101});
        let run = client.ask("/study/rollout", tiny);
        let uncertainty = limit(&run, "error_uncertainty");
        assert!(uncertainty > 0.0, "{uncertainty:e}");
        (run["error"].as_f64(), uncertainty)
    };
    let (known, uncertainty) = swing(1e-4);
    // `tests/study/review.rs` holds the same run against one in twice the digits: some 4.7e-12.
    let off = (known.unwrap() - 4.7e-12).abs();
    assert!(
        off < 2e-13 && off <= uncertainty && uncertainty < 2e-12,
        "{known:?} ± {uncertainty:e}"
    );
    assert_eq!(swing(1e-5).0, None);
    // "Unstable at every timestep", with a warning, where the arm sags and rests.
    let gains = json!({"kp": [8, 2.6667], "ki": [0, 0], "kd": [2.6667, 1]});
    let setpoint = json!([1.694_544_183_420_622_3, -2.503_024_457_368_377_8]);
    client.ask("/pid_controller/set_gains", gains);
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": setpoint}]}}));
    let sagging = client.ask("/study/stability", json!({}));
    assert_eq!(sagging["equilibrium_kind"], "sagging");
    let held = limit(&sagging, "timestep_limit_held");
    assert!((held - 0.456).abs() < 5e-4, "{sagging}");
    client.subscribe("/diagnostics");
    let status = status_with_limit(&mut client, held);
    assert_eq!(
        (&status["level"], text(&status, "warning")),
        (&json!(0), "")
    );
}

/// A hundred thousand samples of five million steps: answered in one frame, while others are served.
#[test]
fn the_largest_answers_are_given_while_the_arm_goes_on() {
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
    other.ask("/study/stability", json!({}));
    let response = client.receive_where("the big answer", |frame| frame["id"] == "big");
    assert_eq!(response["result"], true);
    let values = &response["values"];
    for key in ["times", "positions", "velocities", "efforts", "energy"] {
        assert_eq!(values[key].as_array().unwrap().len(), 100_000, "{key}");
    }
    assert_eq!(values["evaluations"], 1_000_000);
    assert!((values["times"][99_999].as_f64().unwrap() - 100.0).abs() < 1e-9);
}

/// The next status in which the limit is this one.
fn status_with_limit(client: &mut Client, limit: f64) -> Value {
    for _ in 0..20 {
        let status = arm_status(client);
        if text(&status, "timestep_limit").parse() == Ok(limit) {
            return status;
        }
    }
    panic!("{limit} was never told");
}
