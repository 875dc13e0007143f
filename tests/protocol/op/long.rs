//! Payloads that are longer than a node reads: which are refused, and which are cut to what it needs.

use pendularm::protocol::messages::trajectory::joint_trajectory;
use pendularm::protocol::op::{MAX_ARGS, Op, read};

use super::problem;

/// A node's own thread reads them; a worker or another client takes longer ones.
#[test]
fn long_arguments_are_for_workers_and_other_clients() {
    let pad = "1,".repeat(MAX_ARGS / 2);
    let args = |service: &str, args: &str| {
        let frame = format!(r#"{{"op":"call_service","service":"{service}","args":{args}}}"#);
        match read(&frame).op {
            Ok(Op::CallService(call)) => Ok(call.args.payload().get().to_owned()),
            Err(error) => Err(error.to_string()),
            other => panic!("{other:?}"),
        }
    };
    let long = format!(r#"{{"masses":[1,2],"pad":[{pad}1],"masses":[3,4]}}"#);
    assert_eq!(
        args("/arm_sim/set_params", &long).unwrap(),
        r#"{"masses":[3,4]}"#
    );
    for service in ["/arm_sim/integration_step", "/somebody_elses"] {
        assert_eq!(args(service, &long).unwrap(), long);
    }
    for refused in [format!("[{pad}1]"), format!(r#"{{"masses":[{pad}1]}}"#)] {
        let why = args("/arm_sim/set_params", &refused).unwrap_err();
        assert!(
            why.starts_with("call_service: args must be at most 16384 bytes long"),
            "{why}"
        );
    }
    let goal = format!(r#"{{"op":"send_action_goal","action":"/ik_action","args":[{pad}1]}}"#);
    assert!(problem(&goal).starts_with("send_action_goal: args must be at most"));
}

/// Only the last point counts, and only that goes to the arm; where it stands is not lost.
#[test]
fn of_a_long_trajectory_the_arm_hears_the_last_point() {
    let publish = |points: &str| {
        let msg = format!(r#"{{"joint_names":["joint2","joint1"],"points":[{points}]}}"#);
        read(&format!(
            r#"{{"op":"publish","topic":"joint_trajectory","msg":{msg}}}"#
        ))
        .op
    };
    let points = r#"{"positions":[3,4]},"#.repeat(10_000);
    for last in ["[1,2]", "[1,null]", "[1]", "5"] {
        let all = format!(r#"{points}{{"positions":{last}}}"#);
        let Ok(Op::Publish {
            msg,
            heard: Some(heard),
            ..
        }) = publish(&all)
        else {
            panic!("{last}");
        };
        assert!(heard.msg.get().len() < 100 && msg.get().len() > 100_000);
        let joints = ["joint1", "joint2"];
        let whole = joint_trajectory(msg.raw(), &joints);
        assert_eq!(heard.setpoint(&joints), whole, "{last}");
    }
    let why = publish(&format!("[{}1]", "0,".repeat(MAX_ARGS)))
        .unwrap_err()
        .to_string();
    assert!(
        why.starts_with("publish: msg must be at most 16384 bytes"),
        "{why}"
    );
}
