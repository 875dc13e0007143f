//! A motion that several solvers compute, and the error and the cost of every run.
//!
//! The error of a run is its largest distance to one reference, over all steps, or over as many of them as the task
//! says. Its cost is counted in evaluations of the dynamics. For seconds, time [`Task::replay`], which takes the same
//! steps and does no more.
//!
//! **Invariant:** nothing is chosen per solver: same start, same reference, same measure, and for solvers with equal
//! steps the same timesteps.

use super::reference::DoubleDouble;
use super::solvers::{Solver, TaskRun};
use crate::math::count::in_f64;
use crate::study::fewest::fewest;
use crate::study::paused::at_once;

/// A run whose angles are off by a whole turn \[rad\] shows nothing any more, and counts as lost.
pub const LOST: f64 = std::f64::consts::TAU;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunOutcome {
    /// Steps that were to be taken. A solver with a tolerance chooses its steps, and this is their number.
    pub steps: u64,
    /// Length of each \[s\], or their mean.
    pub timestep: f64,
    /// Evaluations of the dynamics, counted.
    pub evaluations: u64,
    /// Largest error over all comparisons and joints \[rad\]; infinite if the run was lost or left the finite numbers.
    pub error: f64,
}

/// Makes the run of a solver with this number of steps ready.
pub(super) type Ready = dyn Fn(Solver, u64) -> Box<dyn TaskRun>;

/// The distance of a place to the reference at a time \[s\].
type Distance = dyn Fn(DoubleDouble, &[f64]) -> f64;

/// A motion to be computed.
pub struct Task {
    /// Simulated time \[s\].
    pub duration: f64,
    /// How far the reference itself may be off \[rad\].
    pub uncertainty: f64,
    /// Comparisons of a run with more steps, at most twice as many.
    pub(super) looks: u64,
    /// The number of steps of every run is a multiple of this.
    pub(super) unit: u64,
    pub(super) ready: Box<Ready>,
    pub(super) distance: Box<Distance>,
}

impl Task {
    /// Takes `steps` steps and compares. A run whose error exceeds `most` ends there and counts as lost. A solver that
    /// chooses its steps may try as many, and is lost if they do not reach the end.
    pub fn run(&self, solver: impl Into<Solver>, steps: u64, most: f64) -> RunOutcome {
        let every = steps.div_ceil(self.looks).max(1);
        let mut run = (self.ready)(solver.into(), steps);
        let timestep = self.duration / in_f64(steps);
        let (mut done, mut error, mut is_over) = (0, 0.0_f64, false);
        while error.is_finite() && !is_over {
            let due = every.min(steps - done);
            let is_finite = run.advance(due);
            done += due;
            let equal = || DoubleDouble::from(timestep) * in_f64(done);
            let chosen = run.chosen().map(|(_, time)| time);
            let off = (self.distance)(chosen.map_or_else(equal, DoubleDouble::from), run.place());
            is_over = chosen.map_or(done == steps, |time| time >= self.duration);
            // NaN is lost too.
            let is_known = is_finite && off <= most && (is_over || done < steps);
            error = if is_known {
                error.max(off)
            } else {
                f64::INFINITY
            };
        }
        let steps = run.chosen().map_or(steps, |(taken, _)| taken);
        RunOutcome {
            steps,
            timestep: self.duration / in_f64(steps),
            evaluations: run.evaluations(),
            error,
        }
    }

    /// The run with the fewest steps that keeps within `most`. A search tries step counts between `first` and `last`,
    /// to a `part` of them: see [`fewest`].
    pub fn fewest(
        &self,
        solver: impl Into<Solver>,
        most: f64,
        (first, last): (u64, u64),
        part: u64,
    ) -> Option<RunOutcome> {
        let (solver, mut best) = (solver.into(), None);
        at_once(fewest(first, last / self.unit, part, |units| {
            let made = self.run(solver.clone(), units * self.unit, most);
            let is_enough = made.error <= most;
            best = is_enough.then_some(made).or(best);
            is_enough
        }));
        best
    }

    /// The same steps without comparing. Returns the last angles, summed \[rad\].
    pub fn replay(&self, solver: Solver, steps: u64) -> f64 {
        let mut run = (self.ready)(solver, steps);
        run.advance(steps);
        run.place().iter().sum()
    }
}
