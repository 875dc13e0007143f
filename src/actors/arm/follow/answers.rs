//! Encoders of feedback and results of `control_msgs/action/FollowJointTrajectory`.
//!
//! **Invariant:** the fields are those of the catalog, and the codes those of the action.

use serde_json::{Value, json};

use crate::actors::arm::sim::joint_names;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::protocol::messages::{Header, Stamp};

/// The result codes of the action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ResultCode {
    Successful = 0,
    InvalidGoal = -1,
    PathToleranceViolated = -4,
    GoalToleranceViolated = -5,
}

/// `control_msgs/action/FollowJointTrajectory_Result`.
pub(super) fn result(code: ResultCode, why: &str) -> Value {
    json!({"error_code": code as i32, "error_string": why})
}

/// `control_msgs/action/FollowJointTrajectory_Feedback` at simulation time `now`, `time` after the start \[s\].
pub(super) fn feedback<const N: usize>(
    now: f64,
    time: f64,
    desired: &Setpoint<N>,
    actual: &State<N>,
) -> Value {
    let time_from_start = Stamp::from_seconds(time);
    let point = |positions: [f64; N], velocities: [f64; N]| {
        json!({
            "positions": positions.as_slice(),
            "velocities": velocities.as_slice(),
            "accelerations": [],
            "effort": [],
            "time_from_start": time_from_start,
        })
    };
    let off = |wanted: [f64; N], is: [f64; N]| {
        let mut off = wanted;
        off.iter_mut().zip(is).for_each(|(off, is)| *off -= is);
        off
    };
    json!({
        "header": Header::world(now),
        "joint_names": joint_names::<N>().as_slice(),
        "desired": point(desired.position, desired.velocity),
        "actual": point(actual.position, actual.velocity),
        "error": point(
            off(desired.position, actual.position),
            off(desired.velocity, actual.velocity),
        ),
    })
}
