//! The command line as beginners type it: unknown fields, and the controller still off.

use serde_json::json;

use super::{ask, refusal, said};
use crate::common::{self, Runtime};

const ENABLE: &str = "/pid_controller/enable";

/// Commands, their names and values, the wrong words, and some of the right ones.
const UNKNOWN_FIELDS: &str = r#"
service call | /pid_controller/enable | {data:true} | "data:true" | {data: true}
service call | /pid_controller/enable | data:true | "data:true" | {data: true}
service call | /pid_controller/enable | {"data:true": null} | "data:true" | data
service call | /pid_controller/enable | {enable: true} | "enable" | known fields: data
service call | arm_sim/set_params | {gravty: 5} | "gravty" | gravity
service call | /arm_sim/set_params | {"Gravity": 5} | "Gravity" | gravity
service call | /arm_sim/set_params | {gravity:5} | "gravity:5" | {gravity: 5}
service call | /arm_sim/reset | {now: 1} | "now" | known fields: none
service call | /ik_trial/start | {duration:5} | "duration:5" | {duration: 5}
service call | /study/stability | {gains: {kP: [1, 1]}} | "gains.kP" | kp
service call | /study/stability | [rk4, {kP: [1, 1]}] | "gains.kP" | kp
topic pub | /joint_trajectory | {point: []} | "point" | points
topic pub | /joint_trajectory | points: [{position: [1, 1]}] | "points[0].position" | positions
topic pub | /joint_trajectory | points: [{positions:[1, 1], velocities:0}] | "points[0].velocities:0" | {velocities: 0}
topic pub | /joint_trajectory | header: {stamps: 1} | "header.stamps" | stamp
action send_goal | /ik_action | {x: 1, y: 1, epsilom: 1} | "epsilom" | epsilon
action send_goal | /joint_trajectory_controller/follow_joint_trajectory | {trajectory: {points: [{positions: [0, 0], time_from_start: {sec: 1}}, {velocity: 1}]}} | "trajectory.points[1].velocity" | velocities
"#;

/// Each is refused before it is sent, with a message that names the wrong word and the right ones.
#[test]
fn a_field_that_is_not_there_is_refused_by_name_and_nothing_is_sent() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_trajectory");
    for row in UNKNOWN_FIELDS.trim().lines() {
        let [command, name, value, wrong, right] =
            row.split(" | ").collect::<Vec<_>>().try_into().expect(row);
        let line = format!("{command} {name} '{value}'");
        let refused = refusal(&runtime, &line, 2);
        assert!(
            refused.contains(wrong) && refused.contains(right),
            "{line}: {refused}"
        );
    }
    // The client receives the first message that is published afterwards: this one.
    client.ask(ENABLE, json!({"data": true}));
    let stamped = "header: {seq: 1, stamp: {secs: 0, nsecs: 0}}, points: [{positions: [0.1, 0.2]}]";
    let line = format!("topic pub -1 /joint_trajectory '{{{stamped}}}'");
    said(&runtime, &line);
    let received = client.message("/joint_trajectory");
    assert_eq!(received["points"][0]["positions"], json!([0.1, 0.2]));
    assert_eq!(
        client.ask("/arm_sim/set_params", json!({}))["gravity"],
        9.81
    );
}

#[test]
fn types_that_the_runtime_does_not_know_have_any_field() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    common::provide(&mut client, "/own");
    let call = std::thread::spawn({
        let line = "service call /own '{any: {thing: 1}, b:c: 2}'";
        let mut command = super::command_line(&runtime, line);
        move || command.output().unwrap()
    });
    let asked = client.receive_where("call", |frame| frame["op"] == "call_service");
    assert_eq!(asked["args"], json!({"any": {"thing": 1}, "b:c": 2}));
    client.send(
        &json!({"op": "service_response", "service": "/own", "id": asked["id"], "values": {}, "result": true}),
    );
    assert_eq!(call.join().unwrap().status.code(), Some(0));
    said(&runtime, "topic pub -1 /own own_msgs/msg/Own '{any: 1}'");
}

#[test]
fn a_command_that_moves_the_arm_hints_that_the_controller_is_off() {
    let runtime = Runtime::start();
    let commands = [
        "topic pub -1 joint_trajectory 'points: [{positions: [0.3, -0.5]}]'",
        "service call /ik_action/send_goal '{x: 1, y: 1}'",
        "service call /ik_trial/start",
        "topic echo /clock --once",
    ];
    for (command, count) in commands.iter().zip([1, 1, 1, 0]) {
        let output = ask(&runtime, command);
        let hint = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{hint}");
        assert_eq!(hint.lines().count(), count, "{hint}");
        assert!(
            count == 0 || hint.contains("/pid_controller/enable"),
            "{hint}"
        );
    }
    said(
        &runtime,
        "service call /pid_controller/enable '{data: true}'",
    );
    for command in commands {
        said(&runtime, command);
    }
}
