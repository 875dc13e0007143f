//! Paths: the action `/joint_trajectory_controller/follow_joint_trajectory`, as in `ros2_control`.
//!
//! While a goal is active the node moves the arm's setpoint along the path, in simulation time, and checks how the
//! arm follows. The rules are in `math::trajectory`. A goal ends when another trajectory, another goal or a reset
//! replaces its setpoint. It also ends when the arm cannot follow ([`Obstacle`]).
//!
//! **Invariant:** at most one goal is active, and each accepted goal has exactly one result.

mod answers;
mod wire;

use std::time::Duration;

use actix::prelude::*;

use self::answers::{ResultCode, feedback, result};
#[cfg(doc)]
use crate::actors::arm::sim::Obstacle;
use crate::actors::arm::sim::{AddBarrier, ArmMotion, ArmSim, JointMotion, MoveSetpoint};
use crate::actors::node::{Barrier, Done, ShutDown};
use crate::actors::wire::action_client::{ActionClient, CancelSent, ForwardGoal};
use crate::math::arm::State;
use crate::math::goal::{Cadence, Dwell};
use crate::math::pid::Setpoint;
use crate::math::trajectory::{Course, JointPath, Standing, Tolerance, Waypoint};
use crate::protocol::op::GoalStatus;
use crate::services::goals::NOT_ACTIVE;

/// Time between two moves of the setpoint, which the arm holds in between. At 1 rad/s the setpoint is some millimetres
/// behind the path.
pub const PERIOD: Duration = Duration::from_millis(5);

/// The reason of a goal that a reset ends.
const RESET: &str = "the arm was reset";

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `joint_trajectory_controller` for an arm of `N` links.
pub struct PathFollower<const N: usize> {
    arm: PathArm<N>,
    active: Option<ActivePath<N>>,
    /// The next move of the setpoint.
    timer: Option<SpawnHandle>,
}

/// The messages to the arm for paths.
#[derive(Clone)]
pub struct PathArm<const N: usize> {
    motion: Recipient<ArmMotion<N>>,
    setpoint: Recipient<MoveSetpoint<N>>,
    add_barrier: Recipient<AddBarrier>,
}

impl<const N: usize> PathArm<N> {
    /// The recipients of this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        Self {
            motion: arm.clone().recipient(),
            setpoint: arm.clone().recipient(),
            add_barrier: arm.clone().recipient(),
        }
    }
}

/// The active goal.
struct ActivePath<const N: usize> {
    course: Course<N>,
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
    pub const fn new(arm: PathArm<N>) -> Self {
        Self {
            arm,
            active: None,
            timer: None,
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A path to follow.
pub struct FollowPath<const N: usize> {
    /// The points after the present pose.
    pub points: Vec<Waypoint<N>>,
    /// Tolerance on the way.
    pub on_the_way: Tolerance<N>,
    /// Tolerance at the end.
    pub at_the_end: Tolerance<N>,
    /// Time after the end in which the joints must arrive \[s\]; infinite for no limit.
    pub patience: f64,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for PathFollower<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        let own = ctx.address().recipient();
        self.arm.add_barrier.do_send(AddBarrier(own));
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ForwardGoal<FollowPath<N>>> for PathFollower<N> {
    type Result = ();

    fn handle(&mut self, goal: ForwardGoal<FollowPath<N>>, ctx: &mut Context<Self>) {
        let motion = self.arm.motion.send(ArmMotion).into_actor(self);
        ctx.wait(motion.map(|motion, node, ctx| match motion {
            Ok(motion) => node.begin(goal, &motion, ctx),
            Err(_) => goal.client.refuse("the arm does not answer"),
        }));
    }
}

impl<const N: usize> Handler<CancelSent> for PathFollower<N> {
    type Result = ();

    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let is_meant = |goal: &ActivePath<N>| goal.client.is(&cancel.goal);
        let Some(goal) = self.active.take_if(|goal| is_meant(goal)) else {
            return cancel.refuse(NOT_ACTIVE);
        };
        let halted = self.halt(goal.setpoint).into_actor(self);
        ctx.wait(halted.map(move |(), _, _| {
            let values = result(ResultCode::Successful, "cancelled");
            goal.client.conclude(values, GoalStatus::Canceled);
            drop(cancel.done);
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
        AtomicResponse::new(Box::pin(self.go_on()))
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
    /// Whether the arm has been reset since the goal began.
    fn is_before_reset(&self, motion: &JointMotion<N>) -> bool {
        motion.resets != self.resets
    }

    fn end(&self, status: GoalStatus, code: ResultCode, why: &str) {
        self.client.conclude(result(code, why), status);
    }
}

impl<const N: usize> PathFollower<N> {
    /// Starts a goal in place of the previous one.
    fn begin(
        &mut self,
        forwarded: ForwardGoal<FollowPath<N>>,
        motion: &JointMotion<N>,
        ctx: &mut Context<Self>,
    ) {
        let ForwardGoal { goal, client, done } = forwarded;
        let start = Waypoint {
            time: 0.0,
            position: motion.state.position,
            velocity: Some(motion.state.velocity),
        };
        if let Some(obstacle) = motion.obstacle {
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
            course: Course {
                path,
                on_the_way: goal.on_the_way,
                at_the_end: goal.at_the_end,
                patience: goal.patience,
                dwell: Dwell::default(),
            },
            client,
            began: motion.time,
            resets: motion.resets,
            setpoint: motion.setpoint,
            feedback: Cadence::default(),
        });
        self.lead(motion, Some(done), ctx);
    }

    /// Checks the arm, and moves its setpoint.
    fn look(&mut self, ctx: &mut Context<Self>) {
        self.timer = None;
        ctx.wait(self.go_on());
    }

    /// The same for a caller that waits for it.
    fn go_on(&self) -> impl ActorFuture<Self, Output = ()> + use<N> {
        let motion = self.arm.motion.send(ArmMotion).into_actor(self);
        motion.map(|motion, node, ctx| match motion {
            Ok(motion) => node.lead(&motion, None, ctx),
            Err(_) => node.abort("the arm does not answer"),
        })
    }

    fn lead(&mut self, motion: &JointMotion<N>, done: Option<Done>, ctx: &mut Context<Self>) {
        let Some(goal) = &mut self.active else {
            return;
        };
        if goal.is_before_reset(motion) {
            return self.abort(RESET);
        }
        if let Some(obstacle) = motion.obstacle {
            return self.abort(&obstacle.to_string());
        }
        let time = motion.time - goal.began;
        let desired = goal.course.path.at(time);
        let standing = goal.course.judge(time, &motion.state);
        let may_be_due = goal.client.wants_feedback && !motion.stands_still;
        if may_be_due && goal.feedback.due(motion.time) {
            let values = feedback(motion.time, time, &desired, &motion.state);
            goal.client.feed_back(values);
        }
        let next = match standing {
            Standing::Moving | Standing::Arrived => desired,
            Standing::OffPath(_) | Standing::Late(_) => at_rest(&motion.state),
        };
        let moved = MoveSetpoint {
            from: std::mem::replace(&mut goal.setpoint, next),
            to: next,
        };
        let moved = self.arm.setpoint.send(moved).into_actor(self);
        ctx.wait(moved.map(move |moved, node, ctx| {
            node.moved(moved.unwrap_or(false), standing, ctx);
            drop(done);
        }));
    }

    /// Handles the answer: the setpoint has been moved, or another one has replaced it.
    fn moved(&mut self, is_ours: bool, standing: Standing, ctx: &mut Context<Self>) {
        if !is_ours {
            return self.tell_why(ctx);
        }
        let (status, code, why) = match standing {
            Standing::Moving => {
                if let Some(before) = self.timer.take() {
                    ctx.cancel_future(before);
                }
                self.timer = Some(ctx.run_later(PERIOD, Self::look));
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

    /// Ends the goal: another setpoint or a reset has replaced its own since the last check.
    fn tell_why(&self, ctx: &mut Context<Self>) {
        let motion = self.arm.motion.send(ArmMotion).into_actor(self);
        ctx.wait(motion.map(|motion, node, _| {
            let goal = node.active.as_ref();
            let reset = goal
                .zip(motion.ok())
                .is_some_and(|(goal, motion)| goal.is_before_reset(&motion));
            node.abort(if reset {
                RESET
            } else {
                "another setpoint has taken its place"
            });
        }));
    }

    /// Ends the goal. Its setpoint has been replaced or is no longer moved.
    fn abort(&mut self, why: &str) {
        if let Some(goal) = self.active.take() {
            goal.end(GoalStatus::Aborted, ResultCode::InvalidGoal, why);
        }
    }

    /// Holds the arm at its present pose, unless another setpoint is active.
    fn halt(&self, from: Setpoint<N>) -> impl Future<Output = ()> + use<N> {
        let arm = self.arm.clone();
        async move {
            if let Ok(motion) = arm.motion.send(ArmMotion).await {
                let to = at_rest(&motion.state);
                let _ = arm.setpoint.send(MoveSetpoint { from, to }).await;
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
