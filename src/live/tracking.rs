//! Goals on the arm. Every physics step is checked, in simulation time.
//!
//! [`LiveArm::track_goal`] announces a goal and ends the previous one. From [`LiveArm::command_goal`] on,
//! steps are checked. A reset in between ends the goal, and the command has no effect.
//!
//! **Invariant:** without a goal this file has no effect on the steps.

use std::ops::ControlFlow;

use super::goals::{GoalOrder, GoalProgress, Obstacle, Pose, Tracked, Tracking, pose};
use super::loads::Loads;
use super::{LiveArm, World};
use crate::math::goal::{Cadence, Goal};
use crate::math::kinematics::{Target, Unreachable, nearest_turn, solve};
use crate::math::pid::Setpoint;
use crate::math::simulation::{ArmInput, Simulation};

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// The present state of the arm.
    #[must_use]
    pub fn pose(&self) -> Pose<N> {
        Pose {
            stands_still: self.paused && self.simulation.time() <= self.paused_at,
            ..pose(&self.simulation, self.goals.past)
        }
    }

    /// Whether each step is checked.
    #[must_use]
    pub fn judges_steps(&self) -> bool {
        let tracked = self.goals.tracked.as_ref();
        tracked.is_some_and(|goal| goal.commanded)
    }

    /// Joint positions that put the end effector on the target, with the elbow on the side of the present pose \[rad\].
    ///
    /// # Errors
    /// If the target is out of reach.
    pub fn solve(&self, target: &Target) -> Result<[f64; N], Unreachable> {
        let (arm, state) = (self.simulation.arm(), self.simulation.state());
        solve(arm.lengths(), &state.position, target)
    }

    /// Begins a goal and ends the previous one, at the same time.
    ///
    /// # Errors
    /// If the target is out of reach. Nothing changes then.
    pub fn track_goal(&mut self, order: &GoalOrder) -> Result<Tracking<N>, Unreachable> {
        let solution = self.solve(&order.target)?;
        self.goals.preempt(&self.simulation);
        let before = self.goals.latest;
        self.goals.tracked = Some(Tracked {
            number: order.number,
            goal: Goal::new(
                order.target.position,
                order.criteria,
                self.simulation.time(),
            ),
            feedback: Cadence::default(),
            commanded: false,
        });
        Ok(Tracking {
            positions: nearest_turn(&solution, &self.simulation.state().position),
            before,
            obstacle: Obstacle::of(&self.simulation),
        })
    }

    /// Holds the goal's setpoint \[rad\] from the next step on, and checks the goal, unless it has ended.
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

    /// Preempts the goal, unless it has ended already. Returns how the latest goal ended.
    pub fn end_goal(&mut self, number: u64) -> Option<GoalProgress<N>> {
        let tracked = self.goals.tracked.as_ref();
        if tracked.is_some_and(|goal| goal.number == number) {
            self.goals.preempt(&self.simulation);
        }
        self.goals.latest
    }

    /// Takes up to `steps` steps, and returns their number. There are fewer if a goal is reached or the simulation
    /// diverges. For a caller that `waits` they also end at feedback, which is returned. While paused, a single step
    /// may be longer than a sixtieth of a second, so each step may have feedback.
    pub(super) fn advance(&mut self, steps: u64, waits: bool) -> (u64, Option<GoalProgress<N>>) {
        let past = self.goals.past;
        let tracked = self.goals.tracked.as_mut();
        let mut loads = Loads::are_watched(&self.simulation).then_some(&mut self.loads);
        if let Some(loads) = &mut loads {
            loads.begin(&self.simulation);
        }
        let Some(tracked) = tracked.filter(|goal| goal.commanded) else {
            let Some(loads) = loads else {
                return (self.simulation.advance(steps), None);
            };
            let count = |simulation: &Simulation<N>| {
                loads.count(simulation);
                ControlFlow::Continue(())
            };
            return (self.simulation.advance_with(steps, count), None);
        };
        let (mut progress, mut reached) = (None, None);
        let world = &self.world;
        let taken = self.simulation.advance_with(steps, |simulation| {
            if let Some(loads) = &mut loads {
                loads.count(simulation);
            }
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

    /// Call this before the simulation is reset. It preempts the goal and informs its owner.
    pub(super) fn end_goal_for_reset(&mut self) {
        let ended = self.goals.preempt(&self.simulation);
        self.goals.past.end(self.simulation.time());
        if let Some(progress) = ended {
            self.world.tell(progress);
        }
    }
}
