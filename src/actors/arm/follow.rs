//! Paths: the action `/joint_trajectory_controller/follow_joint_trajectory`, as in `ros2_control`.
//!
//! While a goal is active the node asks for the arm's pose, and moves its setpoint. The rules are in `live::path`.
//!
//! **Invariant:** at most one goal is active, and each accepted goal has exactly one result.

use actix::prelude::*;

use crate::actors::arm::sim::{ArmPose, MoveSetpoint, Pose};
use crate::actors::node::{
    ActionClient, Barrier, CancelSent, ForwardGoal, Nodes, SentGoal, ShutDown, Unserved, Working,
};
use crate::live::{FollowedPath, PATH_PERIOD, PathEnd};
use crate::protocol::catalog::Action;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::services::goals::NOT_ACTIVE;
use crate::services::trajectory::FollowPath;

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
    path: FollowedPath<N>,
    client: ActionClient,
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
        let path = match FollowedPath::begin(goal, pose) {
            Ok(path) => path,
            Err(why) => return client.refuse(&why),
        };
        self.end(PathEnd::aborted("another goal has taken its place"));
        self.active = Some(ActivePath { path, client });
        self.move_setpoint(pose, Some(working), ctx);
    }

    /// Asks for the arm's pose, then moves its setpoint or ends the goal.
    fn check_arm(&self) -> impl ActorFuture<Self, Output = ()> + use<N> {
        let pose = self.arm.send(ArmPose).into_actor(self);
        pose.map(|pose, node, ctx| match pose {
            Ok(pose) => node.move_setpoint(&pose, None, ctx),
            Err(_) => node.end(PathEnd::aborted(Unserved::NO_ARM.0)),
        })
    }

    /// Moves the setpoint to its point on the path at this pose of the arm. Ends a goal that the arm cannot follow.
    fn move_setpoint(&mut self, pose: &Pose<N>, working: Option<Working>, ctx: &mut Context<Self>) {
        let Some(ActivePath { path, client }) = &mut self.active else {
            return;
        };
        let next = match path.advance(pose, client.wants_feedback) {
            Ok(next) => next,
            Err(end) => return self.end(end),
        };
        if let Some(feedback) = next.feedback {
            client.feed_back(feedback);
        }
        let moved = self.setpoint.send(next.setpoint).into_actor(self);
        ctx.wait(moved.map(move |moved, node, ctx| {
            match (moved, next.end, &node.active) {
                (Ok(Ok(())), None, _) => node.set_timer(ctx),
                (Ok(Ok(())), Some(end), _) => node.end(end),
                (Ok(Err(resets)), _, Some(goal)) => node.end(goal.path.end_replaced(resets)),
                _ => node.end(PathEnd::aborted(Unserved::NO_ARM.0)),
            }
            drop(working);
        }));
    }

    /// Sets the timer for the next move of the setpoint.
    fn set_timer(&mut self, ctx: &mut Context<Self>) {
        if let Some(before) = self.timer.take() {
            ctx.cancel_future(before);
        }
        self.timer = Some(ctx.run_later(PATH_PERIOD, |node, ctx| {
            node.timer = None;
            ctx.wait(node.check_arm());
        }));
    }

    /// Ends the goal, if there is one.
    fn end(&mut self, end: PathEnd) {
        if let Some(goal) = self.active.take() {
            goal.client.conclude(end.result, end.status);
        }
    }

    /// Holds the arm at its present pose, unless another setpoint is active.
    fn halt(&self, path: FollowedPath<N>) -> impl Future<Output = ()> + use<N> {
        let (arm, setpoint) = (self.arm.clone(), self.setpoint.clone());
        async move {
            if let Ok(pose) = arm.send(ArmPose).await {
                let _ = setpoint.send(path.halt(&pose)).await;
            }
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

impl<const N: usize> SentGoal for FollowPath<N> {
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
        let ActivePath { path, client } = goal;
        let halted = self.halt(path).into_actor(self);
        ctx.wait(halted.map(move |(), _, _| {
            let PathEnd { status, result } = PathEnd::cancelled();
            client.conclude(result, status);
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
        self.end(PathEnd::aborted(why));
    }
}
