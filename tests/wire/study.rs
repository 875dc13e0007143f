//! `/study/*`, the limit in `/diagnostics` and `/arm_sim/error_estimate`, from outside.

use std::time::{Duration, Instant};

use crate::common::{Client, Runtime};
use crate::diagnostics::{arm_status, text};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::stability::{limit_held, limits};
use serde_json::{Value, json};

/// The arm as its own services tell it, as the arguments of `/study/stability`.
fn present(client: &mut Client, setpoint: &Value) -> Value {
    let integrator = client.ask("/arm_sim/set_integrator", json!({}));
    json!({
        "integrator": integrator["method"],
        "gains": client.ask("/pid_controller/set_gains", json!({})),
        "params": client.ask("/arm_sim/set_params", json!({})),
        "setpoint": setpoint,
    })
}

#[test]
fn nothing_asks_for_the_present_values_whether_the_controller_is_on_or_off() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        let zeros = json!(vec![0.0; links]);
        // The motion ahead is part of the answer: two calls compare if nothing moves between them.
        client.ask("/arm_sim/pause", json!({"data": true}));
        let fresh = client.ask("/study/stability", json!({}));
        let all = present(&mut client, &zeros);
        assert_eq!(client.ask("/study/stability", all), fresh);
        // The default gains are stable up to 3 ms in every pose.
        let least = fresh["minimum_over_poses_held"].as_f64().unwrap();
        assert!(least > 0.003, "{fresh}");
        assert_eq!(fresh["advised_timestep"], 0.8 * least);

        client.ask("/pid_controller/enable", json!({"data": true}));
        assert_eq!(client.ask("/study/stability", json!({})), fresh);
        client.ask("/arm_sim/set_params", json!({"gravity": 3}));
        client.ask("/arm_sim/set_integrator", json!({"method": "euler"}));
        client.ask("/pid_controller/set_gains", json!({"kp": vec![90; links]}));
        let positions = vec![0.5; links];
        client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
            "msg": {"points": [{"positions": positions}]}}));
        let changed = client.ask("/study/stability", json!({}));
        assert_ne!(changed, fresh);
        let all = present(&mut client, &json!(positions));
        assert_eq!(client.ask("/study/stability", all), changed);
    }
}

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

#[test]
fn the_predictions_are_those_of_the_library() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    let expected = limits(
        &ControlLoop::new(Arm::<3>::default(), Gains::default(), Setpoint::default())
            .with_method(Method::Verlet),
    );
    let values = client.ask("/study/stability", json!({"integrator": "verlet"}));
    for (name, expected) in [
        ("timestep_limit_held", json!(expected.held)),
        ("timestep_limit_continuous", json!(expected.continuous)),
        ("equilibrium", json!([0.0, 0.0, 0.0])),
        ("equilibrium_kind", json!("setpoint")),
        ("minimum_over_poses_held", json!(expected.minimum_held)),
        (
            "minimum_over_poses_continuous",
            json!(expected.minimum_continuous),
        ),
        ("minimum_over_poses_bound", json!(expected.bound)),
        ("certified", json!(true)),
        (
            "worst_pose",
            json!(expected.worst_pose.map(|pose| pose.to_vec())),
        ),
        ("advised_timestep", json!(expected.advised)),
    ] {
        assert_eq!(values[name], expected, "{name}");
    }
    let critical = expected.critical.unwrap();
    assert_eq!(values["critical"]["joint"], critical.joint);
    assert_eq!(
        values["critical"]["growth_per_step"],
        critical.growth_per_step
    );
    assert_eq!(values["critical"]["frequency"], critical.frequency);
}

#[test]
fn asking_changes_nothing_and_a_refusal_says_every_reason() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let before = present(&mut client, &json!([0, 0]));
    let other = json!({"integrator": "euler", "gains": {"kp": [1, 1]}, "params": {"gravity": 1}, "setpoint": [1, 1]});
    client.ask("/study/stability", other.clone());
    let mut run = other;
    run["duration"] = json!(0.1);
    client.ask("/study/rollout", run);
    assert_eq!(present(&mut client, &json!([0, 0])), before);
    // Literals that Python writes reach the fields, and are refused by name.
    client.send_bytes(
        b"{\"op\":\"call_service\",\"service\":\"/study/rollout\",\"id\":7,\"args\":{\"q0\":[NaN,0],\"qdot0\":[0],\
          \"duration\":1e999,\"params\":{\"masses\":[1,Infinity]}}}\n",
    );
    let response = client.receive();
    assert_eq!(
        (&response["id"], &response["result"], &response["values"]),
        (&json!(7), &json!(false), &json!({}))
    );
    assert_eq!(
        response["status"],
        "q0[0] must be a finite number; qdot0 must have 2 entries, got 1; duration must be a finite number; \
         params.masses[1] must be a finite number"
    );
}

#[test]
fn fields_may_be_null_and_arguments_an_array() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let named = json!({"q0": [0.1, 0.2], "duration": 0.5, "integrator": "verlet", "samples": 6});
    let mut expected = client.ask("/study/rollout", named);
    let positional = json!([
        [0.1, 0.2],
        null,
        0.5,
        null,
        "verlet",
        null,
        null,
        null,
        6,
        null
    ]);
    let mut values = client.ask("/study/rollout", positional);
    for values in [&mut expected, &mut values] {
        assert!(values["wall_time"].take().as_f64().unwrap() > 0.0);
    }
    assert_eq!(values, expected);
    assert_eq!(values["times"], json!([0.0, 0.1, 0.2, 0.3, 0.4, 0.5]));
}

/// At equal work, a second of a swing, order 4 is the best; and each knows its error.
#[test]
fn a_teacher_compares_methods_at_equal_work() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        let mut errors = Vec::new();
        for (method, timestep) in [("euler", 0.001), ("midpoint", 0.002), ("rk4", 0.004)] {
            let values = client.ask(
                "/study/rollout",
                json!({"duration": 1, "timestep": timestep, "integrator": method, "reference": true, "samples": 11}),
            );
            assert_eq!(values["evaluations"], 1000);
            errors.push(values["error"].as_f64().expect("finite"));
        }
        assert!(
            errors[0] > 10.0 * errors[1] && errors[1] > 10.0 * errors[2],
            "{errors:?}"
        );
    }
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

#[test]
fn diagnostics_carry_the_limit_and_warn_while_the_timestep_exceeds_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/diagnostics");
    let arm = Arm::<2>::default();
    let free = limit_held(&ControlLoop::free(arm)).unwrap();
    let status = status_with_limit(&mut client, free);
    assert_eq!(
        (&status["level"], text(&status, "warning")),
        (&json!(0), "")
    );

    client.ask("/pid_controller/enable", json!({"data": true}));
    let held = limit_held(&ControlLoop::new(
        arm,
        Gains::default(),
        Setpoint::default(),
    ))
    .unwrap();
    let status = status_with_limit(&mut client, held);
    assert_eq!(status["level"], 0);

    // Never a refusal.
    let values = client.ask("/arm_sim/set_integrator", json!({"timestep": 1.01 * held}));
    assert_eq!(values["timestep"], 1.01 * held);
    client.kept.clear();
    let status = arm_status(&mut client);
    assert_eq!(
        (&status["level"], &status["message"]),
        (&json!(1), &json!("running"))
    );
    assert!(
        text(&status, "warning").contains("rk4 is predicted to be stable"),
        "{status}"
    );

    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.99 * held}));
    client.kept.clear();
    let status = arm_status(&mut client);
    assert_eq!(
        (&status["level"], text(&status, "warning")),
        (&json!(0), "")
    );
}

#[test]
fn the_error_estimate_has_the_documented_fields_ten_times_a_second() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let began = Instant::now();
    client.subscribe("/joint_states");
    client.subscribe("/arm_sim/error_estimate");
    client.message("/arm_sim/error_estimate");
    client.kept.clear();
    for _ in 0..14 {
        client.message("/arm_sim/error_estimate");
    }
    let message = client.message("/arm_sim/error_estimate");
    // A busy machine skips ticks, and makes none up: every sixth has an estimate, however long they take.
    assert_eq!(client.kept.len(), 15 * 6, "states beside 15 estimates");
    let took = began.elapsed();
    assert!(took >= Duration::from_millis(1200), "15 in {took:?}");
    let limit = limit_held(&ControlLoop::free(Arm::<2>::default()));
    let mut keys: Vec<&String> = message.as_object().unwrap().keys().collect();
    keys.sort();
    assert_eq!(
        keys,
        [
            "error_per_second",
            "local_error",
            "method",
            "predicted_limit",
            "timestep",
            "velocity_error"
        ]
    );
    assert_eq!(
        (&message["method"], &message["timestep"]),
        (&json!("rk4"), &json!(0.001))
    );
    assert_eq!(message["predicted_limit"], json!(limit));
    // (ω h)^5 / 120 at some 4 rad/s is 1e-14; rounding leaves some of it.
    assert!(
        (0.0..1e-10).contains(&message["local_error"].as_f64().unwrap()),
        "{message}"
    );
}
