//! The runs, and how they are read: the cost of an error, the order of a method, the time of a step.
//!
//! **Invariant:** every time stands beside the error of the same steps, and nothing is interpolated between two runs.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::error::{RunOutcome, Scene};
use crate::report::figures::slope::slope;
use crate::report::timing::{Effort, Timing, time};
use crate::study::fewest::StepSearch;

/// One scene with all its runs.
pub(super) struct Data {
    pub(super) scene: Box<dyn Scene>,
    /// Runs of ever half the timestep.
    pub(super) runs: Vec<Run>,
    /// The run of each method that reaches each of [`TARGETS`] with the fewest steps.
    pub(super) reached: Vec<(f64, Run)>,
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

/// The fewest steps for an error are found to this part of them.
const RESOLUTION: u64 = 256;

/// No search tries more steps than this: a method that needs more is far from the cheapest.
pub(super) const MOST_SEARCHED: u64 = 1 << 17;

pub(super) const TARGETS: [f64; 5] = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10];

impl Data {
    /// The scene with its runs of ever half the timestep. The runs between them are searched that reach the targets.
    pub(super) fn new(scene: Box<dyn Scene>, runs: Vec<Run>, effort: Effort) -> Self {
        let mut reached = Vec::new();
        for method in Method::ALL {
            // A smaller error takes no fewer steps.
            let mut least = 1;
            for target in TARGETS {
                let enough = runs.iter().find(|run| {
                    let RunOutcome { error, .. } = run.outcome;
                    run.method == method && error <= target && run.outcome.steps <= MOST_SEARCHED
                });
                let fewest = enough
                    .and_then(|run| fewest(&*scene, method, target, (least, run.outcome.steps)));
                least = fewest.map_or(least, |outcome| outcome.steps);
                reached.extend(fewest.map(|outcome| {
                    let timing = time(effort, || scene.replay(method, outcome.steps));
                    let run = Run {
                        method,
                        outcome,
                        timing,
                    };
                    (target, run)
                }));
            }
        }
        Self {
            scene,
            runs,
            reached,
        }
    }

    pub(super) fn of(&self, method: Method) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.method == method)
    }

    /// The run of `method` that reaches `target` with the fewest steps.
    pub(super) fn reaching(&self, method: Method, target: f64) -> Option<&Run> {
        let mut reached = self.reached.iter();
        let of = |one: &&(f64, Run)| one.1.method == method && one.0.to_bits() == target.to_bits();
        reached.find(of).map(|one| &one.1)
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

    /// Median time of an evaluation \[s\] in the runs of a thousand steps and more.
    pub(super) fn evaluation_time(&self) -> Option<f64> {
        let long = self.runs.iter().filter(|run| run.outcome.steps >= 1000);
        let mut times: Vec<f64> = long
            .map(|run| run.timing.minimum / in_f64(run.outcome.evaluations))
            .collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    }

    pub(super) fn unit(&self) -> &'static str {
        if self.scene.links() == 0 { "m" } else { "rad" }
    }
}

/// The run that keeps within `target` with the fewest steps between the two, found to a part of [`RESOLUTION`].
fn fewest(
    scene: &dyn Scene,
    method: Method,
    target: f64,
    (least, most): (u64, u64),
) -> Option<RunOutcome> {
    let mut search = StepSearch::new(least, most).to_part(RESOLUTION);
    let mut best = None;
    while let Some(steps) = search.wanted() {
        let outcome = scene.run_within(method, steps, target);
        let is_enough = outcome.error <= target;
        if is_enough {
            best = Some(outcome);
        }
        search.tell(is_enough);
    }
    best
}

/// The method that reaches `target` with the fewest evaluations, its run, and the next best.
pub(super) type Best<'a> = (&'a Run, Option<&'a Run>);

pub(super) fn best(data: &Data, target: f64) -> Option<Best<'_>> {
    let mut reached: Vec<&Run> = Method::ALL
        .into_iter()
        .filter_map(|method| data.reaching(method, target))
        .collect();
    reached.sort_by_key(|run| run.outcome.evaluations);
    let mut reached = reached.into_iter();
    Some((reached.next()?, reached.next()))
}
