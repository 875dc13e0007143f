//! The setpoint that a `/joint_trajectory` message sets.
//!
//! **Invariant:** the joints are named as a 3-link arm's are.

use pendularm::math::pid::Setpoint;
use pendularm::protocol::op::fields::RejectedField;
use pendularm::protocol::wire::json::Payload;
use pendularm::services::trajectory::read_setpoint;
use proptest::prelude::*;
use serde_json::value::RawValue;

const JOINTS: [&str; 3] = ["joint1", "joint2", "joint3"];

fn read(msg: &str) -> Result<Setpoint<3>, RejectedField> {
    let msg = RawValue::from_string(msg.to_owned()).expect("valid JSON");
    read_setpoint(&Payload::from(msg))
}

/// The setpoint of a message with one point.
fn setpoint(names: &str, positions: &str, velocities: &str) -> Setpoint<3> {
    let msg = format!(
        r#"{{"joint_names":{names},"points":[{{"positions":{positions},"velocities":{velocities}}}]}}"#
    );
    read(&msg).unwrap_or_else(|error| panic!("{msg}: {error}"))
}

fn rejection(msg: &str) -> String {
    match read(msg) {
        Err(error) => error.to_string(),
        Ok(setpoint) => panic!("{msg}: {setpoint:?}"),
    }
}

#[test]
fn only_the_last_point_counts() {
    let setpoint = read(r#"{"points":[5,{"positions":"bad"},{"positions":[1,2,3]}]}"#).unwrap();
    assert_eq!(setpoint.position, [1.0, 2.0, 3.0]);
}

#[test]
fn invalid_velocities_are_zeros() {
    for velocities in [
        "null",
        "[]",
        "[1,2]",
        "[1,2,3,4]",
        "[1,2,1e999]",
        "[1,null,3]",
        "[1,\"2\",3]",
        "5",
        "{}",
    ] {
        assert_eq!(
            setpoint("[]", "[1,2,3]", velocities).velocity,
            [0.0; 3],
            "{velocities}"
        );
    }
    assert_eq!(
        read(r#"{"points":[{"positions":[1,2,3]}]}"#)
            .unwrap()
            .velocity,
        [0.0; 3]
    );
    assert_eq!(
        setpoint("[]", "[1,2,3]", "[4,5,6]").velocity,
        [4.0, 5.0, 6.0]
    );
}

#[test]
fn other_joint_names_are_taken_by_position() {
    for names in [
        "null",
        "5",
        "[]",
        r#"["joint3","joint1"]"#,
        r#"["joint3","joint3","joint1"]"#,
        r#"["a","b","c"]"#,
        r#"["joint3","joint2",1]"#,
        r#"["joint3","joint2","joint1","joint4"]"#,
    ] {
        assert_eq!(
            setpoint(names, "[1,2,3]", "[4,5,6]").position,
            [1.0, 2.0, 3.0],
            "{names}"
        );
    }
}

#[test]
fn a_message_without_a_setpoint_is_rejected_with_the_reason_of_its_row() {
    for (msg, message) in [
        ("{}", "points is required"),
        (r#"{"points":[]}"#, "points must have at least one entry"),
        (r#"{"points":5}"#, "points must be an array, got 5"),
        ("[1]", "msg must be an object, got an array"),
        (
            r#"{"points":[{"positions":[1,2,3]},7]}"#,
            "points[1] must be an object, got 7",
        ),
        (
            r#"{"points":[{"positions":[1,2,3]},{}]}"#,
            "points[1].positions is required",
        ),
        (
            r#"{"joint_names":["joint2"],"points":[{"positions":[1]}]}"#,
            "points[0].positions must have 3 entries, got 1: joint_names lacks joint1, joint3",
        ),
        (
            r#"{"joint_names":["joint9"],"points":[{"positions":[1]}]}"#,
            "points[0].positions must have 3 entries, got 1",
        ),
    ] {
        assert_eq!(rejection(msg), message, "{msg}");
    }
    for (positions, message) in [
        ("null", "must be an array of numbers, got null"),
        ("[]", "must have 3 entries, got 0"),
        ("[1,2,3,4]", "must have 3 entries, got 4"),
    ] {
        let msg = format!(r#"{{"points":[{{"positions":{positions}}}]}}"#);
        assert_eq!(rejection(&msg), format!("points[0].positions {message}"));
    }
    for (entry, message) in [
        ("1e999", "must be a finite number"),
        ("null", "must be a number, got null"),
        ("\"1\"", "must be a number, got \"1\""),
    ] {
        let msg = format!(r#"{{"points":[{{"positions":[1,{entry},3]}}]}}"#);
        assert_eq!(rejection(&msg), format!("points[0].positions[1] {message}"));
    }
}

proptest! {
    #[test]
    fn names_in_any_order_give_every_joint_its_own_value(
        order in Just(vec![0_usize, 1, 2]).prop_shuffle(),
        values in proptest::array::uniform3(-1e3..1e3_f64),
    ) {
        let names: Vec<&str> = order.iter().map(|&joint| JOINTS[joint]).collect();
        let positions: Vec<f64> = order.iter().map(|&joint| values[joint]).collect();
        let msg = serde_json::json!({"joint_names": names, "points": [{"positions": positions}]});
        prop_assert_eq!(read(&msg.to_string()).unwrap().position, values);
    }
}
