//! A motion that several solvers compute, and the error and the cost of every run.
//!
//! The error of a run is its largest distance to one reference, over all steps, or over as many of them as the task
//! says. Its cost is counted in evaluations of the dynamics. For seconds, time [`Task::replay`], which takes the same
//! steps and does no more.
//!
//! **Invariant:** nothing is chosen per solver: same start, same reference, same measure, and for solvers with equal
//! steps the same timesteps.

use super::reference::DoubleDouble;
use crate::math::count::in_f64;
use crate::study::beside::Steppable;
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
    /// The last angles, summed \[rad\].
    pub end: f64,
}

/// A run of a task, step by step.
pub(super) trait TaskRun {
    /// Takes up to `steps` steps. Returns whether the state is still finite.
    fn advance(&mut self, steps: u64) -> bool;
    /// The joint angles \[rad\].
    fn place(&self) -> &[f64];
    /// The joint rates \[rad/s\].
    fn rates(&self) -> &[f64];
    /// Evaluations of the dynamics so far.
    fn evaluations(&self) -> u64;
    /// Steps taken, and the time \[s\], of a solver that chooses its steps.
    fn chosen(&self) -> Option<(u64, f64)> {
        None
    }
}

/// Makes the run of a solver with this number of steps ready.
pub(super) type Ready<S> = dyn Fn(S, u64) -> Box<dyn TaskRun>;

/// The distance of a place to the reference at a time \[s\].
type Distance = dyn Fn(DoubleDouble, &[f64]) -> f64;

/// A motion to be computed by solvers `S`.
pub struct Task<S> {
    /// Simulated time \[s\].
    pub duration: f64,
    /// How far the reference itself may be off \[rad\].
    pub uncertainty: f64,
    /// Comparisons of a run with more steps, at most twice as many.
    pub(super) looks: u64,
    /// The number of steps of every run is a multiple of this.
    pub(super) unit: u64,
    pub(super) ready: Box<Ready<S>>,
    pub(super) distance: Box<Distance>,
}

impl<S: Clone> Task<S> {
    /// Takes `steps` steps and compares. A run whose error exceeds `most` ends there and counts as lost. A solver that
    /// chooses its steps may try as many, and is lost if they do not reach the end.
    pub fn run(&self, solver: S, steps: u64, most: f64) -> RunOutcome {
        let every = steps.div_ceil(self.looks).max(1);
        let mut run = (self.ready)(solver, steps);
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
            end: run.place().iter().sum(),
        }
    }

    /// The run with the fewest steps that keeps within `most`. A search tries step counts between `first` and `last`,
    /// to a `part` of them: see [`fewest`].
    pub fn fewest(
        &self,
        solver: S,
        most: f64,
        (first, last): (u64, u64),
        part: u64,
    ) -> Option<RunOutcome> {
        let mut best = None;
        at_once(fewest(first, last / self.unit, part, |units| {
            let made = self.run(solver.clone(), units * self.unit, most);
            let is_enough = made.error <= most;
            best = is_enough.then_some(made).or(best);
            is_enough
        }));
        best
    }

    /// The same steps without comparing: [`RunOutcome::end`].
    pub fn replay(&self, solver: S, steps: u64) -> f64 {
        let mut run = (self.ready)(solver, steps);
        run.advance(steps);
        run.place().iter().sum()
    }
}

impl<const N: usize> TaskRun for Box<dyn Steppable<N>> {
    fn advance(&mut self, steps: u64) -> bool {
        (**self).advance(steps) == steps
    }

    fn place(&self) -> &[f64] {
        &self.state().position
    }

    fn rates(&self) -> &[f64] {
        &self.state().velocity
    }

    fn evaluations(&self) -> u64 {
        (**self).evaluations()
    }
}
