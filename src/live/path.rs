//! A goal of `/joint_trajectory_controller`: the setpoint on its path, and how the arm follows it, in simulation time.
//! The rules of a path are in `math::trajectory`.
//!
//! A goal ends when another trajectory, another goal or a reset replaces its setpoint. It also ends when the arm cannot
//! follow ([`Obstacle`]).
//!
//! **Invariant:** the setpoint moves only from the goal's own last one.

use std::time::Duration;

#[cfg(doc)]
use super::goals::Obstacle;
use super::goals::Pose;
use crate::math::goal::{Cadence, Dwell};
use crate::math::pid::Setpoint;
use crate::math::trajectory::{JointPath, PathTask, Standing, Waypoint};
use crate::protocol::op::GoalStatus;
use crate::services::trajectory::{
    FollowPath, PathMessage, ResultCode, path_feedback, path_result,
};

/// Time between two moves of the setpoint, which the arm holds in between. At 1 rad/s the setpoint is some millimetres
/// behind the path.
pub const PATH_PERIOD: Duration = Duration::from_millis(5);

/// A path that the arm follows.
pub struct FollowedPath<const N: usize> {
    task: PathTask<N>,
    /// Simulation time of its start \[s\], since the last reset.
    began: f64,
    /// The number of resets of the arm before it.
    resets: u64,
    /// Its last setpoint.
    setpoint: Setpoint<N>,
    feedback: Cadence,
}

/// Moves the setpoint, if it is still the sender's last one. If not, the answer is the number of resets of the arm.
#[derive(Debug, Clone, Copy)]
pub struct MoveSetpoint<const N: usize> {
    /// The sender's last setpoint.
    pub from: Setpoint<N>,
    /// The next one.
    pub to: Setpoint<N>,
}

/// The next move of the setpoint.
pub struct PathMove<const N: usize> {
    /// The move, also at the end of the path.
    pub setpoint: MoveSetpoint<N>,
    /// Feedback, if it is due and wanted.
    pub feedback: Option<PathMessage>,
    /// The end of the path, after the move.
    pub end: Option<PathEnd>,
}

/// The end of a path.
pub struct PathEnd {
    /// The status of the goal.
    pub status: GoalStatus,
    /// The result of the goal.
    pub result: PathMessage,
}

impl PathEnd {
    /// The goal ends because its setpoint has been replaced or can no longer be moved.
    #[must_use]
    pub fn aborted(why: &str) -> Self {
        Self {
            status: GoalStatus::Aborted,
            result: path_result(ResultCode::InvalidGoal, why),
        }
    }

    /// Its client has cancelled the goal.
    #[must_use]
    pub fn cancelled() -> Self {
        Self {
            status: GoalStatus::Canceled,
            result: path_result(ResultCode::Successful, "cancelled"),
        }
    }

    fn reset() -> Self {
        Self::aborted("the arm was reset")
    }

    fn of(standing: Standing) -> Option<Self> {
        use ResultCode::{GoalToleranceViolated, PathToleranceViolated, Successful};
        let (status, code, why) = match standing {
            Standing::Moving => return None,
            Standing::Arrived => (GoalStatus::Succeeded, Successful, String::new()),
            Standing::OffPath(why) => (GoalStatus::Aborted, PathToleranceViolated, why.to_string()),
            Standing::Late(why) => (GoalStatus::Aborted, GoalToleranceViolated, why.to_string()),
        };
        let result = path_result(code, &why);
        Some(Self { status, result })
    }
}

impl<const N: usize> FollowedPath<N> {
    /// A path that begins at this pose of the arm.
    ///
    /// # Errors
    /// If the arm does not follow its setpoint, or the path is not valid.
    pub fn begin(goal: FollowPath<N>, pose: &Pose<N>) -> Result<Self, String> {
        if let Some(obstacle) = pose.obstacle {
            return Err(obstacle.to_string());
        }
        let start = Waypoint {
            time: 0.0,
            position: pose.state.position,
            velocity: Some(pose.state.velocity),
        };
        let path = JointPath::new(start, goal.points).map_err(|why| format!("trajectory.{why}"))?;
        Ok(Self {
            task: PathTask {
                path,
                on_the_way: goal.on_the_way,
                at_the_end: goal.at_the_end,
                patience: goal.patience,
                dwell: Dwell::default(),
            },
            began: pose.time,
            resets: pose.resets,
            setpoint: pose.setpoint,
            feedback: Cadence::default(),
        })
    }

    /// The move of the setpoint to its point on the path at this pose of the arm.
    ///
    /// # Errors
    /// If the arm cannot follow.
    pub fn advance(
        &mut self,
        pose: &Pose<N>,
        wants_feedback: bool,
    ) -> Result<PathMove<N>, PathEnd> {
        if self.resets != pose.resets {
            return Err(PathEnd::reset());
        }
        if let Some(obstacle) = pose.obstacle {
            return Err(PathEnd::aborted(&obstacle.to_string()));
        }
        let time = pose.time - self.began;
        let standing = self.task.judge(time, &pose.state);
        let is_due = wants_feedback && !pose.stands_still && self.feedback.due(pose.time);
        let feedback = is_due.then(|| {
            let desired = self.task.path.at(time);
            path_feedback(pose.time, time, &desired, &pose.state)
        });
        let next = match standing {
            Standing::Moving | Standing::Arrived => {
                self.task.path.held(time, PATH_PERIOD.as_secs_f64())
            }
            Standing::OffPath(_) | Standing::Late(_) => Setpoint::at(pose.state.position),
        };
        let from = std::mem::replace(&mut self.setpoint, next);
        Ok(PathMove {
            setpoint: MoveSetpoint { from, to: next },
            feedback,
            end: PathEnd::of(standing),
        })
    }

    /// The end of the path because another setpoint or a reset, the last of `resets`, has replaced its own.
    #[must_use]
    pub fn end_replaced(&self, resets: u64) -> PathEnd {
        match self.resets == resets {
            true => PathEnd::aborted("another setpoint has taken its place"),
            false => PathEnd::reset(),
        }
    }

    /// The move that makes the arm hold its present pose.
    #[must_use]
    pub fn halt(&self, pose: &Pose<N>) -> MoveSetpoint<N> {
        MoveSetpoint {
            from: self.setpoint,
            to: Setpoint::at(pose.state.position),
        }
    }
}
