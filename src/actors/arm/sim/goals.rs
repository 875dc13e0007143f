//! Goals on the arm: who begins one, who ends one, and the steps that are judged.
//!
//! `ik_action` owns the goal and hears what becomes of it; the rules are `math::goal`'s. A goal is announced with
//! [`TrackGoal`], which puts an end to the one before, and judged from its [`CommandGoal`] on; a reset in between takes
//! the goal away, and the command has no effect.
//!
//! **Invariant:** without a goal the arm steps as if this file did not exist; every goal ends once.

use std::ops::ControlFlow;

use actix::prelude::*;

use super::messages::Obstacle;
use super::messages::{
    AddBarrier, ArmPose, Barrier, CommandGoal, EndGoal, GoalJudged, Pose, TrackGoal, Tracking,
};
use super::node::ArmSim;
use super::state::goals::{Tracked, pose};
use crate::math::goal::{Cadence, Goal};
use crate::math::kinematics::nearest_turn;
use crate::math::pid::Setpoint;
use crate::math::simulation::ArmInput;

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ArmPose<N>> for ArmSim<N> {
    type Result = Pose<N>;

    fn handle(&mut self, _: ArmPose<N>, ctx: &mut Context<Self>) -> Pose<N> {
        self.attend(ctx);
        pose(&self.simulation, self.goals.past)
    }
}

impl<const N: usize> Handler<TrackGoal<N>> for ArmSim<N> {
    type Result = Tracking<N>;

    fn handle(&mut self, message: TrackGoal<N>, ctx: &mut Context<Self>) -> Tracking<N> {
        self.attend(ctx);
        self.goals.preempt(&self.simulation);
        let before = self.goals.latest;
        self.goals.tracked = Some(Tracked {
            number: message.number,
            goal: Goal::new(message.target, message.criteria, self.simulation.time()),
            feedback: Cadence::default(),
            owner: message.owner,
            commanded: false,
        });
        Tracking {
            positions: nearest_turn(&message.solution, &self.simulation.state().position),
            before,
            obstacle: Obstacle::of(&self.simulation),
        }
    }
}

impl<const N: usize> Handler<CommandGoal<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, command: CommandGoal<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let time = self.simulation.time();
        let tracked = self.goals.tracked.as_mut();
        if let Some(tracked) = tracked.filter(|goal| goal.number == command.number) {
            let (target, criteria) = (tracked.goal.target(), tracked.goal.criteria());
            tracked.goal = Goal::new(target, criteria, time);
            tracked.commanded = true;
            self.change(ArmInput::Setpoint(Setpoint::at(command.positions)));
        }
    }
}

impl<const N: usize> Handler<EndGoal<N>> for ArmSim<N> {
    type Result = Option<GoalJudged<N>>;

    fn handle(&mut self, EndGoal { number }: EndGoal<N>, ctx: &mut Context<Self>) -> Self::Result {
        self.attend(ctx);
        if self.goals.is_tracked(number) {
            self.goals.preempt(&self.simulation);
        }
        self.goals.latest
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Takes up to `steps` steps; fewer if a goal is reached on the way, or if the simulation diverges. For a caller
    /// that `waits` they end at feedback too, which the caller finds `underway`: a single step while paused may be
    /// longer than a sixtieth of a second, and each has feedback for every subscriber.
    pub(super) fn advance(&mut self, steps: u64, waits: bool) -> u64 {
        let past = self.goals.past;
        let tracked = self.goals.tracked.as_mut();
        let Some(tracked) = tracked.filter(|goal| goal.commanded) else {
            return self.simulation.advance(steps);
        };
        let (mut progress, mut reached) = (None, None);
        let taken = self.simulation.advance_with(steps, |simulation| {
            (progress, reached) = tracked.judge(simulation, past);
            if (!waits || reached.is_some())
                && let Some(progress) = progress.take()
            {
                tracked.owner.do_send(progress);
            }
            if progress.is_some() || reached.is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        if let Some(progress) = progress {
            self.goals.underway = Some(Box::pin(tracked.owner.clone().send(progress)));
        }
        if let Some(reached) = reached {
            tracked.owner.do_send(reached);
            self.goals.tracked = None;
            self.goals.latest = Some(reached);
        }
        taken
    }

    /// To be called before the simulation is reset: the goal is preempted, and its owner hears of it.
    pub(super) fn end_goal_for_reset(&mut self) {
        let ended = self.goals.preempt(&self.simulation);
        self.goals.past.end(self.simulation.time());
        if let Some((tracked, judged)) = ended {
            tracked.owner.do_send(judged);
        }
    }

    /// Answers once all that the arm has said of goals is published: news of a goal go by way of its owner, and none
    /// may come after the answer that the arm stands still.
    pub(super) fn after_barriers(&self, ctx: &mut Context<Self>, answer: impl FnOnce() + 'static) {
        let owners = self.goals.owners.iter();
        let asked: Vec<_> = owners.map(|owner| owner.send(Barrier)).collect();
        if asked.is_empty() {
            return answer();
        }
        let passed = async move {
            for one in asked {
                // An owner that has ended publishes nothing either.
                let _ = one.await;
            }
        };
        ctx.spawn(passed.into_actor(self).map(move |(), _, _| answer()));
    }
}

impl<const N: usize> Handler<AddBarrier> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, AddBarrier(owner): AddBarrier, _: &mut Context<Self>) {
        self.goals.owners.push(owner);
    }
}
