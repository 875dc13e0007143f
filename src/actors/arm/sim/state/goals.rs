//! The active goal as the arm sees it: judged at every physics step, in simulation time, where the steps are made.
//!
//! **Invariant:** every goal ends once, and whoever asks about the latest end hears the same.

use std::pin::Pin;

use actix::prelude::*;
use glam::DVec2;

use crate::actors::arm::sim::messages::Obstacle;
use crate::actors::arm::sim::messages::{Barrier, GoalJudged, Pose};
use crate::math::goal::{Cadence, Goal, Outcome};
use crate::math::kinematics::forward;
use crate::math::simulation::Simulation;

/// The arm's memory of goals.
#[derive(Default)]
pub(crate) struct Goals<const N: usize> {
    pub(crate) tracked: Option<Tracked<N>>,
    /// How the latest goal ended, for a question that crossed the news on its way.
    pub(crate) latest: Option<GoalJudged<N>>,
    /// A client has sent a setpoint while the controller was off, and it is off still.
    pub(crate) setpoint_waits: bool,
    /// Everything before the last reset.
    pub(crate) past: Past,
    /// The nodes that tell clients of goals, to be asked whether all news have been passed on.
    pub(crate) owners: Vec<Recipient<Barrier>>,
    /// Progress on its way, whose arrival is to be waited for.
    pub(crate) underway: Option<Pin<Box<RecipientRequest<GoalJudged<N>>>>>,
}

/// Everything before the last reset.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Past {
    /// Resets so far.
    pub(crate) resets: u64,
    /// Simulation time up to the last \[s\].
    time: f64,
}

impl Past {
    /// A longer past is forgotten \[s\]: after thirty years a clock no longer tells parts of a second. Long timesteps
    /// lead there soon.
    const LONGEST: f64 = 1e9;

    /// A reset comes, so long after the one before \[s\].
    pub(crate) fn end(&mut self, time: f64) {
        let time = self.time + time;
        self.time = if time < Self::LONGEST { time } else { 0.0 };
        self.resets += 1;
    }
}

/// A goal that has not ended.
pub(crate) struct Tracked<const N: usize> {
    pub(crate) number: u64,
    pub(crate) goal: Goal,
    pub(crate) feedback: Cadence,
    pub(crate) owner: Recipient<GoalJudged<N>>,
    /// Its setpoint is held, and it is judged.
    pub(crate) commanded: bool,
}

impl<const N: usize> Goals<N> {
    pub(crate) fn is_tracked(&self, number: u64) -> bool {
        self.tracked
            .as_ref()
            .is_some_and(|goal| goal.number == number)
    }

    /// Whether each step is judged.
    pub(crate) fn is_judged(&self) -> bool {
        self.tracked.as_ref().is_some_and(|goal| goal.commanded)
    }

    /// Ends the goal, if there is one, where the arm is now.
    pub(crate) fn preempt(
        &mut self,
        simulation: &Simulation<N>,
    ) -> Option<(Tracked<N>, GoalJudged<N>)> {
        let tracked = self.tracked.take()?;
        let mut judged = tracked.stands(simulation, self.past);
        judged.outcome = Some(Outcome::Preempted);
        self.latest = Some(judged);
        Some((tracked, judged))
    }
}

impl<const N: usize> Tracked<N> {
    /// Judges the step that was just made: progress that is to be told, and the news that it is reached.
    pub(crate) fn judge(
        &mut self,
        simulation: &Simulation<N>,
        past: Past,
    ) -> (Option<GoalJudged<N>>, Option<GoalJudged<N>>) {
        let time = simulation.time();
        let reached = self.goal.judge(time, end_effector(simulation));
        let due = self.feedback.due(time);
        if !reached && !due {
            return (None, None);
        }
        let progress = self.stands(simulation, past);
        let end = GoalJudged {
            outcome: Some(Outcome::Reached),
            ..progress
        };
        (due.then_some(progress), reached.then_some(end))
    }

    pub(crate) fn stands(&self, simulation: &Simulation<N>, past: Past) -> GoalJudged<N> {
        GoalJudged {
            number: self.number,
            distance: self.goal.distance(end_effector(simulation)),
            elapsed: self.goal.elapsed(simulation.time()),
            pose: pose(simulation, past),
            outcome: None,
        }
    }
}

/// Position of the end effector \[m\], with the lengths as they are now.
fn end_effector<const N: usize>(simulation: &Simulation<N>) -> DVec2 {
    forward(simulation.arm().lengths(), &simulation.state().position).position
}

/// The arm at this instant.
pub(crate) fn pose<const N: usize>(simulation: &Simulation<N>, past: Past) -> Pose<N> {
    Pose {
        lengths: *simulation.arm().lengths(),
        positions: simulation.state().position,
        time: simulation.time(),
        resets: past.resets,
        simulated: past.time + simulation.time(),
        obstacle: Obstacle::of(simulation),
    }
}
