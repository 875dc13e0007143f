//! `/joint_trajectory_controller/follow_joint_trajectory`, as a planner's client uses it.

use std::time::{Duration, Instant};

use crate::common::{Client, Runtime};
use pendularm::protocol::catalog::Action;
use pendularm::protocol::op::follow::MAX_POINTS;
use serde_json::{Value, json};

const ACTION: &str = "/joint_trajectory_controller/follow_joint_trajectory";

fn point(positions: [f64; 2], at: f64) -> Value {
    let nanosec = (at.fract() * 1e9).round();
    json!({"positions": positions, "time_from_start": {"sec": at.floor(), "nanosec": nanosec}})
}

fn goal(id: &str, args: &Value) -> Value {
    json!({"op": "send_action_goal", "id": id, "action": ACTION, "args": args, "feedback": true,
           "action_type": "control_msgs/action/FollowJointTrajectory"})
}

fn through(points: &[Value]) -> Value {
    json!({"trajectory": {"joint_names": ["joint1", "joint2"], "points": points}})
}

fn result(client: &mut Client) -> Value {
    client.receive_where("the result", |frame| frame["op"] == "action_result")
}

fn outcome(end: &Value) -> (u64, i64, &str) {
    assert_eq!(end["result"], true, "{end}");
    let values = &end["values"];
    let code = values["error_code"].as_i64().unwrap();
    (
        end["status"].as_u64().unwrap(),
        code,
        values["error_string"].as_str().unwrap(),
    )
}

/// A goal as planners make them: times, velocities and tolerances, and the joints in their own order.
#[test]
fn a_path_is_followed_to_its_end_with_feedback_on_the_way() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    let moving = |positions: [f64; 2], velocities: [f64; 2], at: f64| {
        let mut point = point(positions, at);
        point["velocities"] = json!(velocities);
        point["accelerations"] = json!([0.0, 0.0]);
        point
    };
    let points = [
        moving([-0.2, 0.2], [-0.4, 0.4], 0.6),
        moving([-0.4, 0.4], [0.0, 0.0], 1.2),
    ];
    let args = json!({
        "trajectory": {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
                       "joint_names": ["joint2", "joint1"], "points": points},
        "path_tolerance": [{"name": "joint1", "position": 1.0, "velocity": -1, "acceleration": 0}],
        "goal_tolerance": [{"name": "joint1", "position": 0.02}, {"name": "joint2", "position": 0.02}],
        "goal_time_tolerance": {"secs": 10, "nsecs": 0},
        "multi_dof_trajectory": {"joint_names": [], "points": []},
        "component_path_tolerance": [],
        "component_goal_tolerance": [],
    });
    client.send(&goal("plan", &args));
    let end = result(&mut client);
    assert_eq!(
        (&end["id"], &end["action"]),
        (&json!("plan"), &json!(ACTION))
    );
    assert_eq!(outcome(&end), (4, 0, ""));
    let feedback: Vec<&Value> = client
        .kept
        .iter()
        .filter(|frame| frame["op"] == "action_feedback")
        .collect();
    assert!(feedback.len() > 10, "{}", feedback.len());
    for one in &feedback {
        let values = &one["values"];
        for field in Action::FollowJointTrajectory.feedback_fields() {
            assert_eq!(
                values.get(field.name).is_some(),
                field.required,
                "{}: {values}",
                field.name
            );
        }
        for joint in 0..2 {
            let of = |part: &str| values[part]["positions"][joint].as_f64().unwrap();
            assert!((of("desired") - of("actual") - of("error")).abs() < 1e-12);
        }
    }
    let last = feedback.last().unwrap()["values"]["desired"]["positions"].clone();
    assert_eq!(last, json!([0.4, -0.4]), "by name");
    let positions = client.ask("/study/stability", json!({"setpoint": [0.4, -0.4]}));
    assert!(positions["timestep_limit_held"].is_number());
}

#[test]
fn an_arm_that_does_not_follow_is_told_apart_from_one_that_comes_late() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask("/arm_sim/reset", json!({}));
    client.ask("/pid_controller/enable", json!({"data": true}));
    let weak = json!({"kp": [0, 0], "ki": [0, 0], "kd": [0, 0]});
    client.ask("/pid_controller/set_gains", weak);
    let mut args = through(&[point([1.0, 0.0], 0.5)]);
    args["path_tolerance"] = json!([{"name": "joint1", "position": 0.1}]);
    client.send(&goal("a", &args));
    let end = result(&mut client);
    let (status, code, why) = outcome(&end);
    assert_eq!((status, code), (6, -4), "{why}");
    let off = why.strip_prefix("position of joint1 is off by ");
    let off = off.and_then(|rest| rest.strip_suffix(", more than 0.1"));
    // It is more the later the arm looked.
    let off: f64 = off.and_then(|off| off.parse().ok()).expect(why);
    assert!(off > 0.1 && off <= 1.0, "{why}");

    let mut args = through(&[point([1.0, 0.0], 0.1)]);
    args["goal_time_tolerance"] = json!({"sec": 0, "nanosec": 100_000_000});
    client.send(&goal("b", &args));
    let end = result(&mut client);
    let (status, code, why) = outcome(&end);
    assert_eq!((status, code), (6, -5), "{why}");
    assert!(why.contains("more than 0.05"), "{why}");

    let mut args = through(&[point([1.0, 0.0], 0.1)]);
    args["goal_tolerance"] = json!([{"name": "joint1", "position": -1}]);
    client.send(&goal("c", &args));
    assert_eq!(outcome(&result(&mut client)), (4, 0, ""));
}

#[test]
fn a_goal_ends_with_a_cancellation_or_when_its_setpoint_is_gone() {
    let runtime = Runtime::start();
    let (mut client, mut other) = (runtime.connect(), runtime.connect());
    client.ask("/pid_controller/enable", json!({"data": true}));
    let long = through(&[point([0.1, 0.1], 1000.0)]);
    let cancel = |id: &str| json!({"op": "cancel_action_goal", "id": id, "action": ACTION});

    client.send(&goal("a", &long));
    other.send(&cancel("a"));
    assert_eq!(other.status()["level"], "error");
    client.send(&cancel("a"));
    let end = result(&mut client);
    assert_eq!(outcome(&end), (5, 0, "cancelled"));

    client.send(&goal("b", &long));
    client.send(&goal("c", &long));
    let end = result(&mut client);
    assert_eq!((&end["id"], outcome(&end).0), (&json!("b"), 6));

    client.settle();
    other.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"points": [{"positions": [1, 1]}]}}));
    let end = result(&mut client);
    assert_eq!(
        outcome(&end),
        (6, -1, "another setpoint has taken its place")
    );

    client.send(&goal("d", &long));
    client.settle();
    other.ask("/arm_sim/reset", json!({}));
    let end = result(&mut client);
    assert_eq!(outcome(&end), (6, -1, "the arm was reset"));
    client.send(&cancel("d"));
    assert_eq!(client.status()["level"], "error");
}

/// Goals that are none, each with how its refusal begins.
fn unfit_goals() -> Vec<(Value, &'static str)> {
    let good = point([0.1, 0.1], 1.0);
    let many = vec![good.clone(); MAX_POINTS + 1];
    let tolerance = |one: Value| {
        let mut args = through(std::slice::from_ref(&good));
        args["goal_tolerance"] = json!([one]);
        args
    };
    vec![
        (json!({}), "trajectory is required"),
        (json!({"trajectory": 3}), "trajectory must be an object"),
        (
            json!({"trajectory": {"points": [good]}}),
            "trajectory.joint_names must name joint1, joint2",
        ),
        (
            json!({"trajectory": {"joint_names": ["joint1", "joint1"], "points": [good]}}),
            "trajectory.joint_names",
        ),
        (
            through(&[]),
            "trajectory.points must have at least one entry",
        ),
        (
            through(&many),
            "trajectory.points must have at most 4096 entries, got 4097",
        ),
        (
            through(&[good.clone(), good.clone()]),
            "trajectory.points[1].time_from_start must be greater",
        ),
        (
            tolerance(json!({"name": "joint3"})),
            "goal_tolerance[0].name must be that of a joint",
        ),
        (
            tolerance(json!({"name": "joint1", "position": "x"})),
            "goal_tolerance[0].position must be a number",
        ),
    ]
}

/// Paths of one point that is none.
fn unfit_points() -> Vec<(Value, &'static str)> {
    let with = |field: &str, value: Value| {
        let mut point = point([0.1, 0.1], 1.0);
        point[field] = value;
        through(&[point])
    };
    vec![
        (
            with("positions", json!([1])),
            "trajectory.points[0].positions must have 2 entries, got 1",
        ),
        (
            with("positions", json!([1, null])),
            "trajectory.points[0].positions[1] must be a number",
        ),
        (
            with("velocities", json!([1, 2, 3])),
            "trajectory.points[0].velocities must have 2 entries",
        ),
        (
            with("time_from_start", json!(1)),
            "trajectory.points[0].time_from_start must be an object",
        ),
        (
            with("time_from_start", json!({"sec": -1})),
            "trajectory.points[0].time_from_start.sec must be at least 0",
        ),
        (
            with(
                "time_from_start",
                json!({"sec": f64::MAX, "nanosec": f64::MAX}),
            ),
            "trajectory.points[0].time_from_start must be a finite number of seconds",
        ),
        (
            with("positions", json!([f64::MAX, 0])),
            "trajectory.points[0] must be reached from the point before by finite",
        ),
    ]
}

#[test]
fn a_goal_that_is_none_is_refused_by_its_field() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    for (args, why) in unfit_goals().into_iter().chain(unfit_points()) {
        client.send(&goal("x", &args));
        let end = result(&mut client);
        assert_eq!(
            (&end["status"], &end["result"]),
            (&json!(0), &json!(false)),
            "{end}"
        );
        let text = end["values"].as_str().unwrap();
        assert!(text.starts_with(why), "{text}");
    }
    client.send_text(
        &goal(
            "x",
            &through(&[json!({"positions": ["N", 0], "time_from_start": {"sec": 1}})]),
        )
        .to_string()
        .replace("\"N\"", "1e999"),
    );
    let end = result(&mut client);
    assert_eq!(
        end["values"],
        "trajectory.points[0].positions[0] must be a finite number"
    );
}

fn has_no_feedback(said: &[Value]) {
    let is_feedback = |frame: &Value| frame["op"] == "action_feedback";
    assert!(!said.iter().any(is_feedback), "{said:?}");
}

/// The node looks at the arm every 5 ms: so soon after the answer it would still speak of the way.
#[test]
fn a_paused_arm_is_on_no_way_that_there_were_feedback_of() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&goal("long", &through(&[point([0.3, 0.3], 1e3)])));
    for _ in 0..20 {
        client.receive_where("feedback", |frame| frame["op"] == "action_feedback");
        client.ask("/arm_sim/pause", json!({"data": true}));
        client.kept.clear();
        let began = Instant::now();
        while began.elapsed() < Duration::from_millis(12) {
            client.ask("/rosapi/get_time", json!({}));
        }
        has_no_feedback(&client.kept);
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}

#[test]
fn a_paused_arm_that_is_stepped_is_on_its_way_again() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.send(&goal("long", &through(&[point([0.3, 0.3], 1e3)])));
    for _ in 0..3 {
        let taken = client.ask("/arm_sim/step", json!({"steps": 50}));
        let time = taken["time"].as_f64().unwrap();
        let said = client.receive_where("feedback", |frame| frame["op"] == "action_feedback");
        let stamp = &said["values"]["header"]["stamp"];
        let nanosec = stamp["nanosec"].as_f64().unwrap();
        let said = stamp["sec"].as_f64().unwrap() + nanosec / 1e9;
        assert!((said - time).abs() < 1e-8, "{said} at {time}");
    }
}

/// A topic that has the action's name throttles nothing of a goal.
#[test]
fn the_result_of_a_path_is_the_last_that_comes_of_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(
        &json!({"op": "subscribe", "topic": ACTION, "throttle_rate": 100, "queue_length": 3,
            "type": "std_msgs/msg/String"}),
    );
    client.send(&goal("short", &through(&[point([0.1, 0.1], 0.3)])));
    client.receive_where("the result", |frame| frame["op"] == "action_result");
    let said = client.receive_for(Duration::from_millis(500));
    has_no_feedback(&said);
}

/// Stepped in between, and paused again.
#[test]
fn an_arm_that_is_paused_anew_is_on_no_way_either() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/step", json!({"steps": 10}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.send(&goal("long", &through(&[point([0.3, 0.3], 1e3)])));
    let said = client.receive_for(Duration::from_millis(300));
    has_no_feedback(&said);
}

#[test]
fn a_reset_is_answered_when_the_path_has_ended() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask("/pid_controller/enable", json!({"data": true}));
    for _ in 0..5 {
        client.send(&goal("long", &through(&[point([0.3, 0.3], 1e3)])));
        client.receive_where("feedback", |frame| frame["op"] == "action_feedback");
        client.kept.clear();
        client.ask("/arm_sim/reset", json!({}));
        let ends = client
            .kept
            .iter()
            .filter(|frame| frame["op"] == "action_result");
        assert_eq!(ends.count(), 1, "{:?}", client.kept);
    }
}

/// As a newcomer has it who has not read about the switch.
#[test]
fn a_path_for_a_controller_that_is_off_is_refused_and_told_what_switches_it_on() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&goal("x", &through(&[point([0.1, 0.1], 1.0)])));
    let end = result(&mut client);
    assert_eq!((&end["status"], &end["result"]), (&json!(0), &json!(false)));
    let why = end["values"].as_str().unwrap();
    assert!(why.contains("/pid_controller/enable"), "{why}");
}
