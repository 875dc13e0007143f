//! Inverse kinematics and goals: `/ik/solve`, `/ik_action/send_goal` and `/ik_action/cancel_goal`.
//!
//! **Invariant:** a goal of the service and a goal of the action are read in the same way. Its messages have
//! the target and the setpoint with which it was accepted.

use bytes::Bytes;
use serde::Serialize;
use serde_json::{Value, json};

use super::arm::joint_names;
use super::{Address, Ask};
use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::{Target, Unreachable};
use crate::protocol::catalog::Service;
use crate::protocol::messages::{Empty, Stamp};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

// ---- inverse kinematics ---------------------------------------------------------------------------------------------

/// Joint positions \[rad\], each in (-π, π], that put the end effector on the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solve<const N: usize>(pub Target);

impl<const N: usize> Ask for Solve<N> {
    type Answer = Result<[f64; N], Unreachable>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = read_target::<N>(&mut fields);
        let rejected = fields.finish();
        target.map(Self).ok_or(rejected)
    }

    fn write(answer: Result<[f64; N], Unreachable>, to: &Address) -> Bytes {
        to.outcome(answer.map(|positions| json!({"positions": positions.to_vec()})))
    }
}

/// Reads `x`, `y` and `phi`; `None` if one of them, or a field read before, is rejected.
///
/// With two links `phi` is ignored, because the orientation is not free.
fn read_target<const N: usize>(fields: &mut Fields<'_>) -> Option<Target> {
    let x = fields.number("x", Bound::Finite);
    let y = fields.number("y", Bound::Finite);
    let orientation = if N > 2 {
        fields.number("phi", Bound::Finite)
    } else {
        None
    };
    let position = glam::DVec2::new(x?, y?);
    fields.accepted().then_some(Target {
        position,
        orientation,
    })
}

/// A target in the messages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TargetMessage {
    x: f64,
    y: f64,
    /// The orientation, if one was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    phi: Option<f64>,
}

impl From<&Target> for TargetMessage {
    fn from(target: &Target) -> Self {
        Self {
            x: target.position.x,
            y: target.position.y,
            phi: target.orientation,
        }
    }
}

/// A goal of a client. The answer is its id, sent before its trajectory is published.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalRequest<const N: usize> {
    /// The target.
    pub target: Target,
    /// The condition for success.
    pub criteria: Criteria,
}

impl<const N: usize> Ask for GoalRequest<N> {
    type Answer = Result<String, Unreachable>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = read_target::<N>(&mut fields);
        let epsilon = fields.number("epsilon", Bound::Positive);
        let success_hold = fields.number("success_hold", Bound::NonNegative);
        let default = Criteria::default();
        match target.filter(|_| fields.accepted()) {
            None => Err(fields.finish()),
            Some(target) => Ok(Self {
                target,
                criteria: Criteria {
                    epsilon: epsilon.unwrap_or(default.epsilon),
                    success_hold: success_hold.unwrap_or(default.success_hold),
                },
            }),
        }
    }

    fn write(answer: Result<String, Unreachable>, to: &Address) -> Bytes {
        to.outcome(answer.map(|goal_id| json!({"goal_id": goal_id})))
    }
}

request! {
    whole
    /// Preempts a goal if it is the active one. Answered after its result has been published.
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct CancelRequest -> Result<(), CancelRejected>, |fields| {
        /// The id of the goal; `None` for the active one.
        goal_id: Option<String> = fields.text("goal_id").map(std::borrow::Cow::into_owned),
    }

    fn write(answer: Result<(), CancelRejected>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

/// The error for a client that cancels a goal which it has not sent, or which has ended.
pub const NOT_ACTIVE: &str = "id must be that of this connection's active goal";

/// Why no goal was cancelled.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CancelRejected {
    /// No goal is active.
    #[error("no goal is active")]
    NotActive,
    /// The id is that of another goal.
    #[error("goal_id is not that of the active goal, {active}")]
    OtherGoal {
        /// The active goal.
        active: String,
    },
}

/// An accepted goal.
#[derive(Debug, Clone, PartialEq)]
pub struct AcceptedGoal<const N: usize> {
    /// Its number, counted from 1.
    pub number: u64,
    /// Its id for clients.
    pub id: String,
    /// The target.
    pub target: Target,
    /// The published setpoint \[rad\].
    pub positions: [f64; N],
}

impl<const N: usize> AcceptedGoal<N> {
    /// The goal with this number.
    #[must_use]
    pub fn new(number: u64, target: Target, positions: [f64; N]) -> Self {
        Self {
            number,
            id: format!("goal-{number}"),
            target,
            positions,
        }
    }

    /// Its message on `/ik_action/feedback`, from the remaining distance \[m\] and the simulation time since its start
    /// \[s\].
    #[must_use]
    pub fn feedback(&self, distance: f64, elapsed: f64) -> impl Serialize + use<N> {
        object! {
            goal_id: self.id.clone(),
            target: TargetMessage::from(&self.target),
            positions: self.positions.to_vec(),
            distance_remaining: distance,
            elapsed: elapsed,
        }
    }

    /// Its message on `/ik_action/result`.
    #[must_use]
    pub fn result(&self, distance: f64, outcome: Option<Outcome>) -> impl Serialize + use<N> {
        object! {
            goal_id: self.id.clone(),
            outcome: outcome.map_or("", Outcome::name),
            target: TargetMessage::from(&self.target),
            final_distance: distance,
        }
    }

    /// Its setpoint as a `trajectory_msgs/msg/JointTrajectory` of one point, at rest, as soon as possible.
    #[must_use]
    pub fn trajectory(&self) -> Value {
        let now = Stamp::default();
        json!({
            "header": {"stamp": now, "frame_id": ""},
            "joint_names": joint_names::<N>().as_slice(),
            "points": [{
                "positions": self.positions.as_slice(),
                "velocities": vec![0.0; N],
                "accelerations": [],
                "effort": [],
                "time_from_start": now,
            }],
        })
    }
}
