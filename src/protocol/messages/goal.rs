//! Messages of the nodes `ik`, `ik_action` and `ik_trial`: solutions, feedback, results, the status of a trial, and the
//! trajectory that carries a goal's setpoint.
//!
//! **Invariant:** the fields are the catalog's. A missing value is `null`, except `phi` of a target,
//! which is omitted.

use serde::Serialize;
use serde_json::{Value, json};

use crate::protocol::messages::Stamp;

/// A target position of the end effector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TargetMessage {
    /// \[m\].
    pub x: f64,
    /// \[m\].
    pub y: f64,
    /// Orientation of the last link \[rad\], if one was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phi: Option<f64>,
}

/// A message of `/ik_action/feedback`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IkFeedback {
    /// The goal.
    pub goal_id: String,
    /// A target position of the end effector.
    pub target: TargetMessage,
    /// The setpoint that the goal commanded \[rad\].
    pub positions: Vec<f64>,
    /// Distance between end effector and target \[m\].
    pub distance_remaining: f64,
    /// Simulation time since the goal's start \[s\].
    pub elapsed: f64,
}

/// A message of `/ik_action/result`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IkResult {
    /// The goal.
    pub goal_id: String,
    /// `reached` or `preempted`.
    pub outcome: &'static str,
    /// The target position of the end effector.
    pub target: TargetMessage,
    /// Distance between end effector and target at the end \[m\].
    pub final_distance: f64,
}

/// A message of `/ik_trial/status`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialStatus {
    /// Whether the trial is neither over nor stopped.
    pub running: bool,
    /// Simulation time since the start \[s\].
    pub elapsed: f64,
    /// \[s\].
    pub duration: f64,
    /// Targets reached since the start.
    pub targets_reached: u64,
    /// The present target.
    pub target: Option<TargetMessage>,
    /// Distance between end effector and target \[m\], from the latest feedback.
    pub error: Option<f64>,
    /// The setpoint that the goal commanded \[rad\].
    pub desired_positions: Option<Vec<f64>>,
    /// `idle`, `active`, `reached` or `preempted`.
    pub action_status: &'static str,
}

/// A `trajectory_msgs/msg/JointTrajectory` of one point: `positions` \[rad\], at rest, as soon as possible.
#[must_use]
pub fn setpoint_trajectory(joint_names: &[&str], positions: &[f64]) -> Value {
    let now = Stamp::default();
    json!({
        "header": {"stamp": now, "frame_id": ""},
        "joint_names": joint_names,
        "points": [{
            "positions": positions,
            "velocities": vec![0.0; positions.len()],
            "accelerations": [],
            "time_from_start": now,
        }],
    })
}
