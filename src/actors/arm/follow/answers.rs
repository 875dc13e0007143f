//! Encoders of feedback and results of `control_msgs/action/FollowJointTrajectory`.
//!
//! **Invariant:** the fields are those of the catalog, and the codes those of the action.

use serde::Serialize;

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
#[derive(Serialize)]
pub(super) struct FollowResult {
    error_code: i32,
    error_string: String,
}

pub(super) fn result(code: ResultCode, why: &str) -> FollowResult {
    FollowResult {
        error_code: code as i32,
        error_string: why.to_owned(),
    }
}

/// `control_msgs/action/FollowJointTrajectory_Feedback`.
#[derive(Serialize)]
pub(super) struct FollowFeedback {
    header: Header<'static>,
    joint_names: Vec<&'static str>,
    desired: PointMessage,
    actual: PointMessage,
    error: PointMessage,
}

/// `trajectory_msgs/msg/JointTrajectoryPoint`.
#[derive(Serialize)]
struct PointMessage {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: [f64; 0],
    effort: [f64; 0],
    time_from_start: Stamp,
}

/// The feedback at simulation time `now`, `time` after the start \[s\].
pub(super) fn feedback<const N: usize>(
    now: f64,
    time: f64,
    desired: &Setpoint<N>,
    actual: &State<N>,
) -> FollowFeedback {
    let time_from_start = Stamp::from_seconds(time);
    let point = |positions: Vec<f64>, velocities: Vec<f64>| PointMessage {
        positions,
        velocities,
        accelerations: [],
        effort: [],
        time_from_start,
    };
    let off = |wanted: &[f64], is: &[f64]| -> Vec<f64> {
        wanted
            .iter()
            .zip(is)
            .map(|(wanted, is)| wanted - is)
            .collect()
    };
    FollowFeedback {
        header: Header::world(now),
        joint_names: joint_names::<N>().to_vec(),
        desired: point(desired.position.to_vec(), desired.velocity.to_vec()),
        actual: point(actual.position.to_vec(), actual.velocity.to_vec()),
        error: point(
            off(&desired.position, &actual.position),
            off(&desired.velocity, &actual.velocity),
        ),
    }
}
