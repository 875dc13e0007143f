//! Feedback and results of `control_msgs/action/FollowJointTrajectory` in JSON.
//!
//! **Invariant:** the fields are those of the catalogue, and codes are those of the action.

use serde_json::{Value, json};

use crate::actors::arm::sim::joint_names;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::protocol::messages::{Header, Stamp};

/// How a goal has ended, as the action counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ResultCode {
    Successful = 0,
    PathToleranceViolated = -4,
    GoalToleranceViolated = -5,
}

pub(super) fn result(code: ResultCode, why: &str) -> Value {
    json!({"error_code": code as i32, "error_string": why})
}

/// How the arm follows at simulation time `now`, `time` after the start \[s\].
pub(super) fn feedback<const N: usize>(
    now: f64,
    time: f64,
    desired: &Setpoint<N>,
    actual: &State<N>,
) -> Value {
    let stamp = Stamp::from_seconds(time);
    let point = |positions: &[f64], velocities: &[f64]| {
        json!({
            "positions": positions,
            "velocities": velocities,
            "accelerations": [],
            "effort": [],
            "time_from_start": stamp,
        })
    };
    let off = |wanted: &[f64], is: &[f64]| -> Vec<f64> {
        wanted
            .iter()
            .zip(is)
            .map(|(wanted, is)| wanted - is)
            .collect()
    };
    json!({
        "header": Header::world(now),
        "joint_names": joint_names::<N>().as_slice(),
        "desired": point(&desired.position, &desired.velocity),
        "actual": point(&actual.position, &actual.velocity),
        "error": point(
            &off(&desired.position, &actual.position),
            &off(&desired.velocity, &actual.velocity),
        ),
    })
}
