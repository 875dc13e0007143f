//! Goals on the arm: judged at every physics step, in simulation time, where the steps are made.
//!
//! A goal is announced with [`LiveArm::track_goal`], which puts an end to the one before, and judged from
//! [`LiveArm::command_goal`] on. A reset in between takes the goal away, and the command has no effect.
//!
//! **Invariant:** without a goal the arm steps as if this file did not exist.

use std::ops::ControlFlow;

use super::goals::{GoalJudged, GoalOrder, Obstacle, Pose, Tracked, Tracking, pose};
use super::{LiveArm, World};
use crate::math::goal::{Cadence, Goal};
use crate::math::kinematics::nearest_turn;
use crate::math::pid::Setpoint;
use crate::math::simulation::ArmInput;

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// The arm at this instant.
    #[must_use]
    pub fn pose(&self) -> Pose<N> {
        pose(&self.simulation, self.goals.past)
    }

    /// Whether each step is judged.
    #[must_use]
    pub fn judges_steps(&self) -> bool {
        let tracked = self.goals.tracked.as_ref();
        tracked.is_some_and(|goal| goal.commanded)
    }

    /// A goal begins, and the one before it ends, both in this instant.
    pub fn track_goal(&mut self, order: &GoalOrder<N>) -> Tracking<N> {
        self.goals.preempt(&self.simulation);
        let before = self.goals.latest;
        self.goals.tracked = Some(Tracked {
            number: order.number,
            goal: Goal::new(order.target, order.criteria, self.simulation.time()),
            feedback: Cadence::default(),
            commanded: false,
        });
        Tracking {
            positions: nearest_turn(&order.solution, &self.simulation.state().position),
            before,
            obstacle: Obstacle::of(&self.simulation),
        }
    }

    /// The goal's setpoint \[rad\] is held from the next step on, and the goal judged, unless it has ended.
    pub fn command_goal(&mut self, number: u64, positions: [f64; N]) {
        let time = self.simulation.time();
        let tracked = self.goals.tracked.as_mut();
        if let Some(tracked) = tracked.filter(|goal| goal.number == number) {
            let (target, criteria) = (tracked.goal.target(), tracked.goal.criteria());
            tracked.goal = Goal::new(target, criteria, time);
            tracked.commanded = true;
            self.change(ArmInput::Setpoint(Setpoint::at(positions)));
        }
    }

    /// The goal is preempted, unless it has ended already. The answer is how the latest goal ended.
    pub fn end_goal(&mut self, number: u64) -> Option<GoalJudged<N>> {
        let tracked = self.goals.tracked.as_ref();
        if tracked.is_some_and(|goal| goal.number == number) {
            self.goals.preempt(&self.simulation);
        }
        self.goals.latest
    }

    /// Takes up to `steps` steps, and returns how many; fewer if a goal is reached on the way, or if the simulation
    /// diverges. For a caller that `waits` they end at feedback too, which is returned. A single step while paused may
    /// be longer than a sixtieth of a second, and each has feedback for every subscriber.
    pub(super) fn advance(&mut self, steps: u64, waits: bool) -> (u64, Option<GoalJudged<N>>) {
        let past = self.goals.past;
        let tracked = self.goals.tracked.as_mut();
        let Some(tracked) = tracked.filter(|goal| goal.commanded) else {
            return (self.simulation.advance(steps), None);
        };
        let (mut progress, mut reached) = (None, None);
        let world = &self.world;
        let taken = self.simulation.advance_with(steps, |simulation| {
            (progress, reached) = tracked.judge(simulation, past);
            let news = if !waits || reached.is_some() {
                progress.take()
            } else {
                None
            };
            if let Some(news) = news {
                world.tell(news);
            }
            if progress.is_some() || reached.is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        if let Some(reached) = reached {
            self.world.tell(reached);
            self.goals.tracked = None;
            self.goals.latest = Some(reached);
        }
        (taken, progress)
    }

    /// To be called before the simulation is reset: the goal is preempted, and its owner hears of it.
    pub(super) fn end_goal_for_reset(&mut self) {
        let ended = self.goals.preempt(&self.simulation);
        self.goals.past.end(self.simulation.time());
        if let Some(judged) = ended {
            self.world.tell(judged);
        }
    }
}
