//! Paths: the action `/joint_trajectory_controller/follow_joint_trajectory`, as in `ros2_control`.
//!
//! While a goal is active the node moves the arm's setpoint along the path, in simulation time, and checks how the
//! arm follows. The rules are in `math::trajectory`. A goal ends when another trajectory, another goal or a reset
//! replaces its setpoint. It also ends when the arm cannot follow ([`Obstacle`]).
//!
//! **Invariant:** at most one goal is active, and each accepted goal has exactly one result.

mod answers;

use std::time::Duration;

use actix::prelude::*;

use self::answers::{ResultCode, feedback, result};
#[cfg(doc)]
use crate::actors::arm::sim::Obstacle;
use crate::actors::arm::sim::{ArmPose, MoveSetpoint, Pose};
use crate::actors::node::{
    ActionClient, Barrier, CancelSent, ForwardGoal, Goal, Nodes, ShutDown, Unserved, Working,
};
use crate::math::arm::State;
use crate::math::goal::{Cadence, Dwell};
use crate::math::pid::Setpoint;
use crate::math::trajectory::{JointPath, PathTask, Standing, Waypoint};
use crate::protocol::catalog::Action;
use crate::protocol::op::fields::Rejections;
use crate::protocol::op::{Arguments, GoalStatus};
use crate::services::goals::NOT_ACTIVE;
use crate::services::trajectory::FollowPath;

/// Time between two moves of the setpoint, which the arm holds in between. At 1 rad/s the setpoint is some millimetres
/// behind the path.
pub const PERIOD: Duration = Duration::from_millis(5);

/// The reason of a goal that a reset ends.
const RESET: &str = "the arm was reset";

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `joint_trajectory_controller` for an arm of `N` links.
pub struct PathFollower<const N: usize> {
    arm: Recipient<ArmPose<N>>,
    setpoint: Recipient<MoveSetpoint<N>>,
    active: Option<ActivePath<N>>,
    /// The next move of the setpoint.
    timer: Option<SpawnHandle>,
}

/// The active goal.
struct ActivePath<const N: usize> {
    task: PathTask<N>,
    client: ActionClient,
    /// Simulation time of its start \[s\], since the last reset.
    began: f64,
    /// The number of resets of the arm before it.
    resets: u64,
    /// The last setpoint of this node.
    setpoint: Setpoint<N>,
    feedback: Cadence,
}

impl<const N: usize> PathFollower<N> {
    /// A node without a goal.
    #[must_use]
    pub const fn new(arm: Recipient<ArmPose<N>>, setpoint: Recipient<MoveSetpoint<N>>) -> Self {
        Self {
            arm,
            setpoint,
            active: None,
            timer: None,
        }
    }

    /// Adds this node's action to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve_action::<FollowPath<N>, _>(address.clone());
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

impl<const N: usize> Goal for FollowPath<N> {
    const ACTION: Action = Action::FollowJointTrajectory;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        Self::read(arguments)
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for PathFollower<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ForwardGoal<FollowPath<N>>> for PathFollower<N> {
    type Result = ();

    fn handle(&mut self, goal: ForwardGoal<FollowPath<N>>, ctx: &mut Context<Self>) {
        let pose = self.arm.send(ArmPose).into_actor(self);
        ctx.wait(pose.map(|pose, node, ctx| match pose {
            Ok(pose) => node.begin(goal, &pose, ctx),
            Err(_) => goal.client.refuse(Unserved::NO_ARM.0),
        }));
    }
}

impl<const N: usize> Handler<CancelSent> for PathFollower<N> {
    type Result = ();

    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let is_meant = |goal: &ActivePath<N>| cancel.is_of(&goal.client);
        let Some(goal) = self.active.take_if(|goal| is_meant(goal)) else {
            return cancel.refuse(NOT_ACTIVE);
        };
        let halted = self.halt(goal.setpoint).into_actor(self);
        ctx.wait(halted.map(move |(), _, _| {
            let values = result(ResultCode::Successful, "cancelled");
            goal.client.conclude(values, GoalStatus::Canceled);
            drop(cancel.working);
        }));
    }
}

impl<const N: usize> Handler<Barrier> for PathFollower<N> {
    type Result = AtomicResponse<Self, ()>;

    /// Checks the arm first: a reset may have ended the goal, and this must be sent before the reset is answered.
    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) -> Self::Result {
        if self.active.is_none() {
            return AtomicResponse::new(Box::pin(std::future::ready(()).into_actor(self)));
        }
        AtomicResponse::new(Box::pin(self.check_arm()))
    }
}

impl<const N: usize> Handler<ShutDown> for PathFollower<N> {
    type Result = ();

    fn handle(&mut self, ShutDown(why): ShutDown, _: &mut Context<Self>) {
        self.abort(why);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ActivePath<N> {
    fn end(&self, status: GoalStatus, code: ResultCode, why: &str) {
        self.client.conclude(result(code, why), status);
    }
}

impl<const N: usize> PathFollower<N> {
    /// Starts a goal in place of the previous one.
    fn begin(
        &mut self,
        forwarded: ForwardGoal<FollowPath<N>>,
        pose: &Pose<N>,
        ctx: &mut Context<Self>,
    ) {
        let ForwardGoal {
            goal,
            client,
            working,
        } = forwarded;
        let start = Waypoint {
            time: 0.0,
            position: pose.state.position,
            velocity: Some(pose.state.velocity),
        };
        if let Some(obstacle) = pose.obstacle {
            return client.refuse(&obstacle.to_string());
        }
        let path = match JointPath::new(start, goal.points) {
            Ok(path) => path,
            Err(why) => return client.refuse(&format!("trajectory.{why}")),
        };
        if let Some(before) = self.active.take() {
            let why = "another goal has taken its place";
            before.end(GoalStatus::Aborted, ResultCode::InvalidGoal, why);
        }
        self.active = Some(ActivePath {
            task: PathTask {
                path,
                on_the_way: goal.on_the_way,
                at_the_end: goal.at_the_end,
                patience: goal.patience,
                dwell: Dwell::default(),
            },
            client,
            began: pose.time,
            resets: pose.resets,
            setpoint: pose.setpoint,
            feedback: Cadence::default(),
        });
        self.move_setpoint(pose, Some(working), ctx);
    }

    /// The next move of the setpoint is due.
    fn move_on_timer(&mut self, ctx: &mut Context<Self>) {
        self.timer = None;
        ctx.wait(self.check_arm());
    }

    /// Asks for the arm's pose, then moves its setpoint or ends the goal.
    fn check_arm(&self) -> impl ActorFuture<Self, Output = ()> + use<N> {
        let pose = self.arm.send(ArmPose).into_actor(self);
        pose.map(|pose, node, ctx| match pose {
            Ok(pose) => node.move_setpoint(&pose, None, ctx),
            Err(_) => node.abort(Unserved::NO_ARM.0),
        })
    }

    /// Moves the setpoint to its place on the path at this pose of the arm. Ends a goal that the arm cannot follow.
    fn move_setpoint(&mut self, pose: &Pose<N>, working: Option<Working>, ctx: &mut Context<Self>) {
        let Some(goal) = &mut self.active else {
            return;
        };
        if goal.resets != pose.resets {
            return self.abort(RESET);
        }
        if let Some(obstacle) = pose.obstacle {
            return self.abort(&obstacle.to_string());
        }
        let time = pose.time - goal.began;
        let desired = goal.task.path.at(time);
        let standing = goal.task.judge(time, &pose.state);
        let may_be_due = goal.client.wants_feedback && !pose.stands_still;
        if may_be_due && goal.feedback.due(pose.time) {
            let values = feedback(pose.time, time, &desired, &pose.state);
            goal.client.feed_back(values);
        }
        let next = match standing {
            Standing::Moving | Standing::Arrived => goal.task.path.held(time, PERIOD.as_secs_f64()),
            Standing::OffPath(_) | Standing::Late(_) => at_rest(&pose.state),
        };
        let moved = MoveSetpoint {
            from: std::mem::replace(&mut goal.setpoint, next),
            to: next,
        };
        let moved = self.setpoint.send(moved).into_actor(self);
        ctx.wait(moved.map(move |moved, node, ctx| {
            match moved {
                Ok(Ok(())) => node.continue_or_end(standing, ctx),
                Ok(Err(resets)) => node.end_replaced(resets),
                Err(_) => node.abort(Unserved::NO_ARM.0),
            }
            drop(working);
        }));
    }

    /// After a move of the setpoint: sets the timer for the next move, or ends the goal.
    fn continue_or_end(&mut self, standing: Standing, ctx: &mut Context<Self>) {
        let (status, code, why) = match standing {
            Standing::Moving => {
                if let Some(before) = self.timer.take() {
                    ctx.cancel_future(before);
                }
                self.timer = Some(ctx.run_later(PERIOD, Self::move_on_timer));
                return;
            }
            Standing::Arrived => (GoalStatus::Succeeded, ResultCode::Successful, String::new()),
            Standing::OffPath(excess) => {
                let code = ResultCode::PathToleranceViolated;
                (GoalStatus::Aborted, code, excess.to_string())
            }
            Standing::Late(excess) => {
                let code = ResultCode::GoalToleranceViolated;
                (GoalStatus::Aborted, code, excess.to_string())
            }
        };
        if let Some(goal) = self.active.take() {
            goal.end(status, code, &why);
        }
    }

    /// Ends the goal: another setpoint or a reset, the last of `resets`, has replaced its own.
    fn end_replaced(&mut self, resets: u64) {
        let goal = self.active.as_ref();
        let is_reset = goal.is_some_and(|goal| goal.resets != resets);
        self.abort(if is_reset {
            RESET
        } else {
            "another setpoint has taken its place"
        });
    }

    /// Ends the goal. Its setpoint has been replaced or is no longer moved.
    fn abort(&mut self, why: &str) {
        if let Some(goal) = self.active.take() {
            goal.end(GoalStatus::Aborted, ResultCode::InvalidGoal, why);
        }
    }

    /// Holds the arm at its present pose, unless another setpoint is active.
    fn halt(&self, from: Setpoint<N>) -> impl Future<Output = ()> + use<N> {
        let (arm, setpoint) = (self.arm.clone(), self.setpoint.clone());
        async move {
            if let Ok(pose) = arm.send(ArmPose).await {
                let to = at_rest(&pose.state);
                let _ = setpoint.send(MoveSetpoint { from, to }).await;
            }
        }
    }
}

fn at_rest<const N: usize>(state: &State<N>) -> Setpoint<N> {
    Setpoint {
        position: state.position,
        velocity: [0.0; N],
    }
}
