//! `/study/gains`, `/study/plan` and `pendularm plan`, from outside.

use std::process::Command;

use crate::common::Runtime;
use serde_json::json;

#[test]
fn suggested_gains_change_nothing_and_can_be_set() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let heavy = json!({"masses": [20, 20], "lengths": [2, 2]});
    client.ask("/arm_sim/set_params", heavy);
    let before = client.ask("/pid_controller/set_gains", json!({}));
    let found = client.ask("/study/gains", json!({"settling_time": 3, "margin": 2}));
    assert_eq!(client.ask("/pid_controller/set_gains", json!({})), before);
    assert!(found["margin"].as_f64().unwrap() >= 2.0, "{found}");
    assert!(found["settled_after"].as_f64().unwrap() <= 3.0, "{found}");
    assert_eq!(found["certified"], true, "{found}");

    let gains = json!({"kp": found["kp"], "ki": found["ki"], "kd": found["kd"]});
    assert_eq!(
        client.ask("/pid_controller/set_gains", gains.clone()),
        gains
    );
    let limits = client.ask("/study/stability", json!({}));
    assert_eq!(limits["minimum_over_poses_held"], found["timestep_limit"]);

    for margin in [0.5, 0.0, -1.0] {
        let response = client.call("/study/gains", json!({"margin": margin}));
        assert_eq!(response["result"], false);
        assert_eq!(response["status"], "margin must be at least 1");
    }
}

#[test]
fn a_plan_names_method_timestep_and_control_period() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let swing = json!({"error": 1e-4, "duration": 2, "q0": [0.4, -0.3], "qdot0": [0, 0]});
    let plan = client.ask("/study/plan", swing);
    assert_eq!(plan["integrator"], "rk4");
    assert!(plan["control_period"].is_null(), "{plan}");
    assert!(plan["error"].as_f64().unwrap() <= 1e-4, "{plan}");
    assert_eq!(plan["methods"][0], plan["integrator"]);
    assert_eq!(plan["timesteps"][0], plan["timestep"]);

    let servo = json!({"error": 0.01, "servo": true, "setpoint": [0.8, -0.6], "q0": [0, 0], "qdot0": [0, 0]});
    let plan = client.ask("/study/plan", servo);
    assert_eq!(plan["control_period"], plan["timestep"]);
    assert!(plan["error"].as_f64().unwrap() <= 0.01, "{plan}");

    let response = client.call("/study/plan", json!({"duration": 1}));
    assert_eq!(response["result"], false);
    assert!(
        response["status"].as_str().unwrap().starts_with("error"),
        "{response}"
    );
}

#[test]
fn the_command_plans_and_refuses_like_the_service() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_pendularm"))
            .arg("plan")
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let (status, out, _) = run(&["--error", "1e-4", "--duration", "2"]);
    assert_eq!(status, Some(0));
    assert!(out.contains("Plan: rk4"), "{out}");
    let (status, out, _) = run(&[
        "--error",
        "0.01",
        "--duration",
        "servo",
        "--setpoint=-0.4,0.6",
    ]);
    assert_eq!(status, Some(0));
    assert!(out.contains("control period"), "{out}");
    let (status, out, _) = run(&["--error", "1e300", "--duration", "0.1"]);
    assert_eq!(status, Some(0));
    assert!(
        out.contains("for 0.1 s, end effector within 1e300 m:"),
        "{out}"
    );
    let (status, _, complaint) = run(&["--error", "0"]);
    assert_eq!(status, Some(2));
    assert!(
        complaint.contains("--error must be a number greater than 0"),
        "{complaint}"
    );
    let (status, _, complaint) = run(&["--error", "1e-3", "--duration", "200"]);
    assert_eq!(status, Some(1));
    assert!(
        complaint.contains("error must be larger or duration shorter"),
        "{complaint}"
    );
}
