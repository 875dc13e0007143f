//! Goals of `control_msgs/action/FollowJointTrajectory` in JSON.
//!
//! **Invariant:** a long goal is read on another thread, and its client's later frames wait.

use actix::prelude::*;

use super::{FollowPath, PathFollower};
use crate::actors::arm::sim::joint_names;
use crate::actors::wire::Nodes;
use crate::actors::wire::action_client::Goal;
use crate::math::trajectory::{Tolerance, Waypoint};
use crate::protocol::catalog::Action;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::protocol::op::trajectory::{FollowGoal, JointTolerance};

/// Default position tolerance of each joint at the end \[rad\].
const GOAL_TOLERANCE: f64 = 0.05;
/// Default velocity tolerance of each joint at the end \[rad/s\]: the default of `ros2_control`.
const STOPPED_VELOCITY: f64 = 0.01;
/// Both.
const AT_THE_END: [Option<f64>; 2] = [Some(GOAL_TOLERANCE), Some(STOPPED_VELOCITY)];
/// Default time after the end in which the joints must arrive \[s\].
const GOAL_TIME: f64 = 5.0;

impl<const N: usize> PathFollower<N> {
    /// Adds this node's action to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.carry_out::<FollowPath<N>, _>(address.clone());
    }
}

impl<const N: usize> Goal for FollowPath<N> {
    const ACTION: Action = Action::FollowJointTrajectory;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        let goal = FollowGoal::read(arguments, &joint_names::<N>())?;
        // The reader has checked the number of values.
        let array = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
        let points = goal.points.iter().map(|point| Waypoint {
            time: point.time,
            position: array(&point.position),
            velocity: point.velocity.as_deref().map(array),
        });
        Ok(Self {
            points: points.collect(),
            on_the_way: tolerance([None; 2], &goal.path_tolerance),
            at_the_end: tolerance(AT_THE_END, &goal.goal_tolerance),
            patience: match goal.goal_time_tolerance {
                0.0 => GOAL_TIME,
                none if none < 0.0 => f64::INFINITY,
                patience => patience,
            },
        })
    }
}

/// The default tolerances of position and velocity, for missing values and 0.
fn tolerance<const N: usize>(
    [position, velocity]: [Option<f64>; 2],
    given: &[JointTolerance],
) -> Tolerance<N> {
    let mut tolerance = Tolerance {
        position: [position; N],
        velocity: [velocity; N],
    };
    let of = |value: f64, default: Option<f64>| match value {
        0.0 => default,
        value => Some(value).filter(|value| *value > 0.0),
    };
    for one in given {
        if let Some(limit) = tolerance.position.get_mut(one.joint) {
            *limit = of(one.position, position);
        }
        if let Some(limit) = tolerance.velocity.get_mut(one.joint) {
            *limit = of(one.velocity, velocity);
        }
    }
    tolerance
}
