//! Goals on the arm: their start, their end, and the barriers before the arm reports that it is at rest.
//!
//! `ik_action` owns the goal and gets its news. `live/goals.rs` checks the steps.
//!
//! **Invariant:** an answer that the arm is at rest follows all news of goals.

use actix::prelude::*;

use super::messages::{AddBarrier, ArmPose, Barrier, CommandGoal, EndGoal, TrackGoal};
use super::node::ArmSim;
use crate::live::{GoalOrder, GoalProgress, Pose, Tracking};

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ArmPose<N>> for ArmSim<N> {
    type Result = Pose<N>;

    fn handle(&mut self, _: ArmPose<N>, ctx: &mut Context<Self>) -> Pose<N> {
        self.attend(ctx);
        self.arm.pose()
    }
}

impl<const N: usize> Handler<TrackGoal<N>> for ArmSim<N> {
    type Result = Tracking<N>;

    fn handle(&mut self, message: TrackGoal<N>, ctx: &mut Context<Self>) -> Tracking<N> {
        self.attend(ctx);
        let TrackGoal {
            number,
            target,
            criteria,
            solution,
            owner,
        } = message;
        self.arm.world.owner = Some(owner);
        self.arm.track_goal(&GoalOrder {
            number,
            target,
            criteria,
            solution,
        })
    }
}

impl<const N: usize> Handler<CommandGoal<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, command: CommandGoal<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.arm.command_goal(command.number, command.positions);
    }
}

impl<const N: usize> Handler<EndGoal<N>> for ArmSim<N> {
    type Result = Option<GoalProgress<N>>;

    fn handle(&mut self, EndGoal { number }: EndGoal<N>, ctx: &mut Context<Self>) -> Self::Result {
        self.attend(ctx);
        self.arm.end_goal(number)
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Answers after all news of goals have been published. The owner of a goal publishes them, and none may
    /// follow the answer that the arm is at rest.
    pub(super) fn after_barriers(&self, ctx: &mut Context<Self>, answer: impl FnOnce() + 'static) {
        let owners = self.owners.iter();
        let asked: Vec<_> = owners.map(|owner| owner.send(Barrier)).collect();
        if asked.is_empty() {
            return answer();
        }
        let passed = async move {
            for one in asked {
                // An owner that has ended publishes nothing.
                let _ = one.await;
            }
        };
        ctx.spawn(passed.into_actor(self).map(move |(), _, _| answer()));
    }
}

impl<const N: usize> Handler<AddBarrier> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, AddBarrier(owner): AddBarrier, _: &mut Context<Self>) {
        self.owners.push(owner);
    }
}
