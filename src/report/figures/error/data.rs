//! The runs, and how they are read: the cost of an error, the order of a method, the time of a step.
//!
//! **Invariant:** every time stands beside the error of the same steps.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::error::{RunOutcome, Scene};
use crate::report::figures::slope::slope;
use crate::report::timing::Timing;

/// One scene with all its runs.
pub(super) struct Data {
    pub(super) scene: Box<dyn Scene>,
    pub(super) runs: Vec<Run>,
}

#[derive(Clone, Copy)]
pub(super) struct Run {
    pub(super) method: Method,
    pub(super) outcome: RunOutcome,
    pub(super) timing: Timing,
}

/// Errors between which a slope is fitted \[rad\]: above, higher orders still show; below, rounding does.
const ASYMPTOTIC: std::ops::Range<f64> = 1e-11..1e-3;

/// How many runs a slope is fitted to.
const FITTED: usize = 4;

pub(super) const TARGETS: [f64; 5] = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10];

impl Data {
    pub(super) fn of(&self, method: Method) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.method == method)
    }

    /// The cost at which `method` reaches `target`, where two neighbouring runs lie on both sides of it: interpolated
    /// between them along a straight line in logarithms. The coarsest run, if it is already better.
    pub(super) fn reaching(&self, method: Method, target: f64) -> Option<Cost> {
        let mut before: Option<&Run> = None;
        for run in self.of(method) {
            if run.outcome.error <= target {
                let Some(coarse) = before.filter(|run| run.outcome.diverged.is_none()) else {
                    return Some(Cost::of(run));
                };
                let part = (coarse.outcome.error / target).ln()
                    / (coarse.outcome.error / run.outcome.error).ln();
                return Some(Cost::of(coarse).towards(&Cost::of(run), part));
            }
            before = Some(run);
        }
        None
    }

    pub(super) fn order(&self, method: Method) -> Option<f64> {
        let inside: Vec<(f64, f64)> = self
            .of(method)
            .filter(|run| ASYMPTOTIC.contains(&run.outcome.error))
            .map(|run| (run.outcome.timestep, run.outcome.error))
            .collect();
        // The finest of them: near the stability edge an error falls faster than its order.
        slope(inside.into_iter().rev().take(FITTED))
    }

    /// Time of one step \[s\]: the least that any run of a thousand steps and more shows.
    pub(super) fn step_time(&self, method: Method) -> Option<f64> {
        self.of(method)
            .filter(|run| run.outcome.steps >= 1000 && run.outcome.diverged.is_none())
            .map(|run| run.timing.minimum / in_f64(run.outcome.steps))
            .min_by(f64::total_cmp)
    }

    pub(super) fn unit(&self) -> &'static str {
        if self.scene.links() == 0 { "m" } else { "rad" }
    }
}

/// The work that it takes.
#[derive(Clone, Copy)]
pub(super) struct Cost {
    pub(super) timestep: f64,
    pub(super) evaluations: f64,
    pub(super) wall: f64,
}

impl Cost {
    fn of(run: &Run) -> Self {
        Self {
            timestep: run.outcome.timestep,
            evaluations: in_f64(run.outcome.evaluations),
            wall: run.timing.minimum,
        }
    }

    fn towards(self, other: &Self, part: f64) -> Self {
        let between = |a: f64, b: f64| a * (b / a).powf(part);
        Self {
            timestep: between(self.timestep, other.timestep),
            evaluations: between(self.evaluations, other.evaluations),
            wall: between(self.wall, other.wall),
        }
    }
}

/// A method and its cost, and the next best.
pub(super) type Best = (Method, Cost, Option<(Method, Cost)>);

/// The method that reaches `target` with the fewest evaluations, its cost, and the next best.
pub(super) fn best(data: &Data, target: f64) -> Option<Best> {
    let mut reached: Vec<(Method, Cost)> = Method::ALL
        .into_iter()
        .filter_map(|method| Some((method, data.reaching(method, target)?)))
        .collect();
    reached.sort_by(|a, b| a.1.evaluations.total_cmp(&b.1.evaluations));
    let mut reached = reached.into_iter();
    let (method, cost) = reached.next()?;
    Some((method, cost, reached.next()))
}
