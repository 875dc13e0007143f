//! The active goal in the arm, and the record of earlier goals. The rules are in `math::goal`.
//!
//! **Invariant:** every goal ends once, and every query about the latest end has the same result.

use glam::DVec2;

use crate::math::arm::State;
use crate::math::goal::{Cadence, Criteria, Goal, Outcome};
use crate::math::kinematics::{Target, forward, nearest_turn};
use crate::math::pid::Setpoint;
use crate::math::simulation::Simulation;
use crate::protocol::catalog::Service;

/// Why the arm does not follow its setpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Obstacle {
    /// Its simulation has diverged.
    #[error("the arm has diverged and does not move; {} clears this", Service::Reset.name())]
    Diverged,
    /// Its controller is off.
    #[error(
        "the controller is off, so the arm does not follow its setpoint; {} with data true switches it on",
        Service::Enable.name()
    )]
    ControllerOff,
}

impl Obstacle {
    pub(crate) fn of<const N: usize>(simulation: &Simulation<N>) -> Option<Self> {
        if simulation.divergence().is_some() {
            Some(Self::Diverged)
        } else {
            (!simulation.pid().is_enabled()).then_some(Self::ControllerOff)
        }
    }
}

/// The state of the arm at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<const N: usize> {
    /// Lengths of the links \[m\].
    pub lengths: [f64; N],
    /// Joint positions and velocities.
    pub state: State<N>,
    /// The held joint state.
    pub setpoint: Setpoint<N>,
    /// Simulation time since the last reset \[s\].
    pub time: f64,
    /// Resets of the arm so far.
    pub resets: u64,
    /// Simulation time since the start of the arm, over all resets \[s\]. It decreases only at a reset
    /// after thirty years.
    pub simulated: f64,
    /// Whether it is paused and no step has been taken since.
    pub stands_still: bool,
    /// Why it does not follow its setpoint; `None` if it does.
    pub obstacle: Option<Obstacle>,
}

impl<const N: usize> Pose<N> {
    /// The state of a moving arm.
    pub(super) fn of(simulation: &Simulation<N>, past: Past) -> Self {
        Self {
            lengths: *simulation.arm().lengths(),
            state: *simulation.state(),
            setpoint: *simulation.pid().setpoint(),
            time: simulation.time(),
            resets: past.resets,
            simulated: past.time + simulation.time(),
            stands_still: false,
            obstacle: Obstacle::of(simulation),
        }
    }
}

/// A goal for the arm.
#[derive(Debug, Clone, Copy)]
pub struct GoalOrder {
    /// Identifies the goal. Each id is used once.
    pub number: u64,
    /// The target of the end effector.
    pub target: Target,
    /// The condition for success.
    pub criteria: Criteria,
}

/// The goal has begun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking<const N: usize> {
    /// The solution, shifted by whole turns to within π of the present positions \[rad\]: the setpoint to publish.
    pub positions: [f64; N],
    /// How the previous goal ended, if there was one.
    pub before: Option<GoalProgress<N>>,
    /// Why the arm does not follow that setpoint yet; `None` if it does.
    pub obstacle: Option<Obstacle>,
}

/// The progress of a goal after a step, or its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalProgress<const N: usize> {
    /// The goal.
    pub number: u64,
    /// Distance between end effector and target \[m\].
    pub distance: f64,
    /// Simulation time since the goal's start \[s\].
    pub elapsed: f64,
    /// The state of the arm at that time.
    pub pose: Pose<N>,
    /// How it ended; `None` while it is active.
    pub outcome: Option<Outcome>,
}

/// The past before the last reset.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Past {
    /// The number of resets.
    pub(crate) resets: u64,
    /// Simulation time up to the last reset \[s\].
    time: f64,
}

impl Past {
    /// Longest recorded past \[s\]. After thirty years a double cannot resolve small parts of a second. With long
    /// timesteps this is reached soon.
    const LONGEST: f64 = 1e9;

    /// Records a reset, with the time since the previous one \[s\].
    fn end(&mut self, time: f64) {
        let time = self.time + time;
        self.time = if time < Self::LONGEST { time } else { 0.0 };
        self.resets += 1;
    }
}

/// The arm's record of goals.
#[derive(Default)]
pub(crate) struct Goals<const N: usize> {
    tracked: Option<Tracked>,
    /// How the latest goal ended, for a query that was sent before its news arrived.
    latest: Option<GoalProgress<N>>,
    /// A client has sent a setpoint while the controller was off, and the controller is still off.
    pub(crate) setpoint_waits: bool,
    /// The past before the last reset.
    pub(super) past: Past,
}

impl<const N: usize> Goals<N> {
    /// Whether there is a goal that has not ended.
    pub(crate) fn is_tracked(&self) -> bool {
        self.tracked.is_some()
    }

    /// Whether a goal or a setpoint waits for the controller, which is off.
    pub(super) fn are_held_up(&self, simulation: &Simulation<N>) -> bool {
        let is_meant_to_move = self.is_tracked() || self.setpoint_waits;
        is_meant_to_move && !simulation.pid().is_enabled()
    }

    /// Whether each step is checked.
    pub(super) fn judge_steps(&self) -> bool {
        self.tracked.as_ref().is_some_and(|goal| goal.commanded)
    }

    /// The goal against which each step is checked.
    pub(super) fn commanded(&mut self) -> Option<&mut Tracked> {
        self.tracked.as_mut().filter(|goal| goal.commanded)
    }

    /// Begins a goal with this solution, in place of the previous one.
    pub(super) fn track(
        &mut self,
        order: &GoalOrder,
        solution: &[f64; N],
        simulation: &Simulation<N>,
    ) -> Tracking<N> {
        self.preempt(simulation);
        self.tracked = Some(Tracked {
            number: order.number,
            goal: Goal::new(order.target.position, order.criteria, simulation.time()),
            feedback: Cadence::default(),
            commanded: false,
        });
        Tracking {
            positions: nearest_turn(solution, &simulation.state().position),
            before: self.latest,
            obstacle: Obstacle::of(simulation),
        }
    }

    /// The goal's setpoint is held from this time on \[s\], and each step is checked. Returns `false` if it has ended.
    pub(super) fn command(&mut self, number: u64, time: f64) -> bool {
        let tracked = self.tracked.as_mut();
        let Some(tracked) = tracked.filter(|goal| goal.number == number) else {
            return false;
        };
        let (target, criteria) = (tracked.goal.target(), tracked.goal.criteria());
        tracked.goal = Goal::new(target, criteria, time);
        tracked.commanded = true;
        true
    }

    /// Preempts the goal, unless it has ended already. Returns how the latest goal ended.
    pub(super) fn end(
        &mut self,
        number: u64,
        simulation: &Simulation<N>,
    ) -> Option<GoalProgress<N>> {
        let tracked = self.tracked.as_ref();
        if tracked.is_some_and(|goal| goal.number == number) {
            self.preempt(simulation);
        }
        self.latest
    }

    /// The goal has been reached.
    pub(super) fn end_reached(&mut self, progress: GoalProgress<N>) {
        self.tracked = None;
        self.latest = Some(progress);
    }

    /// Ends the goal, if there is one, before the simulation is reset.
    pub(super) fn end_for_reset(&mut self, simulation: &Simulation<N>) -> Option<GoalProgress<N>> {
        let ended = self.preempt(simulation);
        self.past.end(simulation.time());
        ended
    }

    /// Ends the goal, if there is one, in the arm's present state.
    fn preempt(&mut self, simulation: &Simulation<N>) -> Option<GoalProgress<N>> {
        let tracked = self.tracked.take()?;
        let mut progress = tracked.progress(simulation, self.past);
        progress.outcome = Some(Outcome::Preempted);
        self.latest = Some(progress);
        Some(progress)
    }
}

/// A goal that has not ended.
pub(super) struct Tracked {
    number: u64,
    goal: Goal,
    feedback: Cadence,
    /// Its setpoint is held, and each step is checked.
    commanded: bool,
}

impl Tracked {
    /// Checks the last step: returns due feedback, and the news that the goal is reached.
    pub(super) fn judge<const N: usize>(
        &mut self,
        simulation: &Simulation<N>,
        past: Past,
    ) -> (Option<GoalProgress<N>>, Option<GoalProgress<N>>) {
        let time = simulation.time();
        let reached = self.goal.judge(time, end_effector(simulation));
        let due = self.feedback.due(time);
        if !reached && !due {
            return (None, None);
        }
        let progress = self.progress(simulation, past);
        let end = GoalProgress {
            outcome: Some(Outcome::Reached),
            ..progress
        };
        (due.then_some(progress), reached.then_some(end))
    }

    fn progress<const N: usize>(&self, simulation: &Simulation<N>, past: Past) -> GoalProgress<N> {
        GoalProgress {
            number: self.number,
            distance: self.goal.distance(end_effector(simulation)),
            elapsed: self.goal.elapsed(simulation.time()),
            pose: Pose::of(simulation, past),
            outcome: None,
        }
    }
}

/// Position of the end effector \[m\], with the present lengths.
fn end_effector<const N: usize>(simulation: &Simulation<N>) -> DVec2 {
    forward(simulation.arm().lengths(), &simulation.state().position).position
}
