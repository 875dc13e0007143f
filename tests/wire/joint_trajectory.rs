//! `/joint_trajectory` from outside: the last point is the setpoint.

use crate::arm::{is_near, numbers, send_trajectory, state, state_where, trajectory};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

/// An arm without gravity, paused in the starting pose with a controller whose effort spells out the setpoint: kp = 1,
/// kd = 0.001, no ki. One step after a resume the effort is `q* + 0.001 q̇*`, within what 1 ms moves.
struct Probe {
    client: Client,
    links: usize,
}

impl Probe {
    fn on(runtime: &Runtime, links: usize) -> Self {
        let mut client = runtime.connect();
        let all = |value: f64| vec![value; links];
        client.ask(
            "/arm_sim/set_params",
            json!({"gravity": 0, "masses": all(1e6)}),
        );
        // It has been falling until now.
        client.ask("/arm_sim/reset", json!({}));
        client.ask(
            "/pid_controller/set_gains",
            json!({"kp": all(1.0), "ki": all(0.0), "kd": all(1e-3)}),
        );
        client.ask("/pid_controller/enable", json!({"data": true}));
        client.subscribe("/joint_states");
        Self { client, links }
    }

    /// The setpoint that the runtime holds, position plus a thousandth of the velocity. The arm is so heavy that it stays
    /// where it is, within a millionth.
    fn setpoint(&mut self) -> Vec<f64> {
        let held = state(&mut self.client);
        let efforts = numbers(&held["effort"]);
        assert_eq!(efforts.len(), self.links);
        efforts
            .iter()
            .map(|effort| (effort * 1e4).round() / 1e4)
            .collect()
    }

    /// Sends `msg`; the setpoint from the first step after.
    fn after(&mut self, msg: &Value) -> Vec<f64> {
        self.client.ask("/arm_sim/reset", json!({}));
        send_trajectory(&mut self.client, msg);
        let before = crate::arm::stamp(&state(&mut self.client));
        state_where(&mut self.client, "another step", |state| {
            crate::arm::stamp(state) > before
        });
        self.setpoint()
    }

    /// Sends `msg`, which must be refused: the error status.
    fn refused(&mut self, msg: &Value) -> String {
        let before = self.setpoint();
        self.client.send(
            &json!({"op": "publish", "id": [7, "a"], "topic": "/joint_trajectory", "msg": msg}),
        );
        let status = self.client.status();
        assert_eq!(status["level"], "error", "{status}");
        assert_eq!(status["id"], json!([7, "a"]), "{status}");
        assert_eq!(self.setpoint(), before, "the setpoint stays");
        status["msg"].as_str().unwrap().to_owned()
    }
}

fn point(positions: Value, velocities: Value) -> Value {
    json!({"positions": positions, "velocities": velocities})
}

#[test]
fn the_last_point_is_held_and_the_others_are_skipped() {
    let runtime = Runtime::start();
    let mut probe = Probe::on(&runtime, 2);
    let full = json!({
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": ["joint1", "joint2"],
        "points": [{"positions": [0.3, -0.5], "velocities": [0.0, 0.0], "accelerations": [],
            "time_from_start": {"sec": 5, "nanosec": 0}}]});
    assert_eq!(probe.after(&full), [0.3, -0.5]);
    let many = json!({"points": [
        point(json!([9, 9]), json!([])),
        point(json!("rubbish"), json!(null)),
        point(json!([0.25, 0.5]), json!([0.0, 0.0]))]});
    assert_eq!(probe.after(&many), [0.25, 0.5]);
}

#[test]
fn velocities_that_are_missing_or_bad_are_zeros() {
    let runtime = Runtime::start();
    let mut probe = Probe::on(&runtime, 2);
    let positions = json!([0.25, 0.5]);
    assert_eq!(
        probe.after(&json!({"points": [point(positions.clone(), json!([100, -200]))]})),
        [0.35, 0.3]
    );
    for velocities in [
        json!([]),
        json!([100]),
        json!([100, 100, 100]),
        json!(null),
        json!("x"),
        json!([100, null]),
        json!(["1", 1]),
    ] {
        let held = probe.after(&json!({"points": [point(positions.clone(), velocities.clone())]}));
        assert_eq!(held, [0.25, 0.5], "{velocities}");
    }
    for literal in ["NaN", "1e999", "-Infinity"] {
        probe.client.ask("/arm_sim/reset", json!({}));
        probe.client.send_bytes(
            format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{{\"points\":[{{\"positions\":[0.25,0.5],\"velocities\":[1,{literal}]}}]}}}}\n")
                .as_bytes(),
        );
        state_where(&mut probe.client, "the setpoint", |state| {
            numbers(&state["effort"])[0] > 0.2
        });
        assert_eq!(probe.setpoint(), [0.25, 0.5], "{literal}");
    }
    assert_eq!(probe.after(&trajectory(&[0.25, 0.5])), [0.25, 0.5]);
}

#[test]
fn a_permutation_of_the_names_gives_the_values_by_name() {
    let runtime = Runtime::with_links(3);
    let mut probe = Probe::on(&runtime, 3);
    let named = |names: Value| json!({"joint_names": names, "points": [point(json!([0.1, 0.2, 0.3]), json!([100, 200, 300]))]});
    assert_eq!(
        probe.after(&named(json!(["joint3", "joint1", "joint2"]))),
        [0.4, 0.6, 0.2]
    );
    assert_eq!(
        probe.after(&named(json!(["joint1", "joint2", "joint3"]))),
        [0.2, 0.4, 0.6]
    );
    // Anything else is taken by position.
    for names in [
        json!([]),
        json!(null),
        json!(["a", "b", "c"]),
        json!(["joint3", "joint3", "joint1"]),
        json!("joint3"),
        json!(["joint3", "joint1"]),
        json!(["joint3", "joint1", "joint2", "joint4"]),
    ] {
        assert_eq!(
            probe.after(&named(names.clone())),
            [0.2, 0.4, 0.6],
            "{names}"
        );
    }
    let mut absent = named(json!([]));
    absent.as_object_mut().unwrap().remove("joint_names");
    assert_eq!(probe.after(&absent), [0.2, 0.4, 0.6]);
}

#[test]
fn bad_positions_are_refused_to_the_sender_by_name_and_change_nothing() {
    let runtime = Runtime::start();
    let mut probe = Probe::on(&runtime, 2);
    assert_eq!(probe.after(&trajectory(&[0.5, 0.25])), [0.5, 0.25]);
    for positions in [
        json!([]),
        json!([1]),
        json!([1, 2, 3]),
        json!(null),
        json!("1"),
        json!([1, null]),
        json!([1, "2"]),
        json!([true, 1]),
    ] {
        let why = probe.refused(&json!({"points": [point(positions.clone(), json!([]))]}));
        assert!(
            why.contains("/joint_trajectory") && why.contains("positions"),
            "{positions}: {why}"
        );
    }
    for msg in [
        json!({}),
        json!({"points": []}),
        json!({"points": null}),
        json!({"points": [5]}),
        json!({"points": {}}),
        json!({"points": [{}]}),
        json!({"points": [point(json!([1, 1]), json!([])), {}]}),
    ] {
        let why = probe.refused(&msg);
        assert!(why.contains("points"), "{msg}: {why}");
    }
}

#[test]
fn positions_that_are_not_finite_are_refused_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for literal in ["NaN", "Infinity", "-Infinity", "1e999"] {
        client.send_bytes(
            format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{{\"points\":[{{\"positions\":[1,{literal}]}}]}}}}\n")
                .as_bytes(),
        );
        let status = client.status();
        assert_eq!(status["level"], "error");
        assert!(status.get("id").is_none(), "none came: {status}");
        assert!(
            status["msg"].as_str().unwrap().contains("positions[1]"),
            "{status}"
        );
    }
}

#[test]
fn the_error_names_the_joints_that_a_subset_leaves_out() {
    let runtime = Runtime::with_links(3);
    let mut probe = Probe::on(&runtime, 3);
    let why = probe.refused(&json!({"joint_names": ["joint2"], "points": [{"positions": [1.0]}]}));
    assert!(
        why.contains("joint1") && why.contains("joint3") && !why.contains("joint2"),
        "{why}"
    );
}

#[test]
fn a_subscriber_sees_every_message_as_it_came_also_a_bad_one_and_hears_no_error() {
    let runtime = Runtime::start();
    let mut watcher = runtime.connect();
    watcher.subscribe("/joint_trajectory");
    let mut sender = runtime.connect();
    for msg in [
        r#"{"points":[{"positions":[0.10,  -5e-1]}],"extra":12345678901234567890123}"#,
        r#"{"points":[]}"#,
        r#"{"a":1}"#,
    ] {
        sender.send_bytes(
            format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{msg}}}")
                .as_bytes(),
        );
        let line = watcher.receive_text();
        assert_eq!(
            line,
            format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{msg}}}")
        );
    }
    assert_eq!(sender.status()["level"], "error");
    assert_eq!(sender.status()["level"], "error");
    watcher.settle();
    assert!(watcher.kept.is_empty(), "{:?}", watcher.kept);
}

#[test]
fn a_trajectory_needs_no_advertisement_but_respects_a_withdrawn_one() {
    let runtime = Runtime::start();
    let mut probe = Probe::on(&runtime, 2);
    assert_eq!(probe.after(&trajectory(&[0.5, 0.5])), [0.5, 0.5]);
    probe
        .client
        .send(&json!({"op": "unadvertise", "topic": "/joint_trajectory"}));
    assert_eq!(
        probe.after(&trajectory(&[0.75, 0.75])),
        [0.0, 0.0],
        "dropped"
    );
    probe.client.send(&json!({"op": "advertise", "topic": "/joint_trajectory", "type": "trajectory_msgs/msg/JointTrajectory"}));
    assert_eq!(probe.after(&trajectory(&[0.75, 0.75])), [0.75, 0.75]);
}

#[test]
fn a_trajectory_counts_while_the_controller_is_off() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    send_trajectory(&mut client, &trajectory(&[0.5, -0.25]));
    client.ask("/pid_controller/enable", json!({"data": true}));
    state_where(&mut client, "an arm at the setpoint", |state| {
        is_near(state, &[0.5, -0.25], 0.01)
    });
}

#[test]
fn a_trajectory_counts_while_the_arm_is_paused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    send_trajectory(&mut client, &trajectory(&[0.5, -0.25]));
    client.ask("/arm_sim/pause", json!({"data": false}));
    state_where(&mut client, "an arm at the setpoint", |state| {
        is_near(state, &[0.5, -0.25], 0.01)
    });
}
