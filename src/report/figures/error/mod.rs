//! Error against evaluations, time and timestep, in every scene and for every method.
//!
//! **Invariant:** every time stands beside the error of the same steps; runs that are lost are drawn as lost.

mod plots;
mod tables;
mod words;

use plots::{against_evaluations, against_time, against_timestep};
use tables::{cheapest, orders, real_time, scene_list};
use words::{findings, verdicts};

use super::slope::slope;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::{Csv, Field};
use crate::report::experiments::error::{OUTPUTS, Outcome, Scene, scenes};
use crate::report::making::Making;
use crate::report::section::{Block, Section};
use crate::report::timing::{Effort, Timing, time};

/// One scene with all its runs.
struct Data {
    scene: Box<dyn Scene>,
    runs: Vec<Run>,
}

#[derive(Clone, Copy)]
struct Run {
    method: Method,
    outcome: Outcome,
    timing: Timing,
}

/// Errors between which a slope is fitted \[rad\]: above, higher orders still show; below, rounding does.
const ASYMPTOTIC: std::ops::Range<f64> = 1e-11..1e-3;

/// How many runs a slope is fitted to.
const FITTED: usize = 4;

const TARGETS: [f64; 5] = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10];

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let data = compute(making);
    making.keep("work-precision", table_of_runs(&data));
    making.keep("work-precision-time", table_of_runs(&data));
    making.keep("convergence", table_of_runs(&data));
    let mut section = Section {
        findings: findings(&data),
        verdicts: verdicts(&data),
        glance: vec![Block::Table(cheapest(&data))],
        ..Section::default()
    };
    section
        .blocks
        .push(Block::Figure(against_evaluations(&data)));
    section.blocks.push(Block::Figure(against_time(&data)));
    section.blocks.push(Block::Figure(against_timestep(&data)));
    section.blocks.push(Block::Table(orders(&data)));
    section.blocks.push(Block::Table(real_time(&data)));
    section.blocks.push(Block::Table(scene_list(&data)));
    section
}

fn compute(making: &mut Making<'_>) -> Vec<Data> {
    let halvings = making.choose(15, 9);
    let effort = making.choose(
        Effort {
            least: 3,
            most: 25,
            seconds: 0.05,
        },
        Effort {
            least: 3,
            most: 7,
            seconds: 0.01,
        },
    );
    let scenes = scenes();
    let of = scenes.len() * Method::ALL.len() * (halvings + 1);
    let mut done = 0;
    let mut data = Vec::new();
    for scene in scenes {
        let mut runs = Vec::new();
        for halving in 0..=halvings {
            let steps = OUTPUTS << halving;
            if steps > scene.most_steps() {
                continue;
            }
            for method in Method::ALL {
                runs.push(Run {
                    method,
                    outcome: scene.run(method, steps),
                    timing: time(effort, || scene.replay(method, steps)),
                });
                done += 1;
                making.at(done, of);
            }
        }
        data.push(Data { scene, runs });
    }
    data
}

impl Data {
    fn of(&self, method: Method) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.method == method)
    }

    /// The cost at which `method` reaches `target`, where two neighbouring runs lie on both sides of it: interpolated
    /// between them along a straight line in logarithms. The coarsest run, if it is already better.
    fn reaching(&self, method: Method, target: f64) -> Option<Cost> {
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

    fn order(&self, method: Method) -> Option<f64> {
        let inside: Vec<(f64, f64)> = self
            .of(method)
            .filter(|run| ASYMPTOTIC.contains(&run.outcome.error))
            .map(|run| (run.outcome.timestep, run.outcome.error))
            .collect();
        // The finest of them: near the stability edge an error falls faster than its order.
        slope(inside.into_iter().rev().take(FITTED))
    }

    /// Time of one step \[s\]: the least that any run of a thousand steps and more shows.
    fn step_time(&self, method: Method) -> Option<f64> {
        self.of(method)
            .filter(|run| run.outcome.steps >= 1000 && run.outcome.diverged.is_none())
            .map(|run| run.timing.minimum / in_f64(run.outcome.steps))
            .min_by(f64::total_cmp)
    }

    fn unit(&self) -> &'static str {
        if self.scene.links() == 0 { "m" } else { "rad" }
    }
}

/// The work that it takes.
#[derive(Clone, Copy)]
struct Cost {
    timestep: f64,
    evaluations: f64,
    wall: f64,
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

fn table_of_runs(data: &[Data]) -> Csv {
    let mut csv = Csv::new(
        "scene,links,method,variant,control,dt,n_steps,rhs_evals,wall_min_s,wall_med_s,wall_iqr_s,repeats,\
         err_max_rad,err_end_rad,err_tip_m,dE_max_scaled,status,ref_uncertainty",
    );
    for data in data {
        for run in &data.runs {
            let Run {
                method,
                outcome,
                timing,
            } = run;
            let (low, high) = timing.quartiles;
            csv.row(&[
                data.scene.name().into(),
                (data.scene.links() as u64).into(),
                method.name().into(),
                "as shipped".into(),
                data.scene.control().into(),
                outcome.timestep.into(),
                outcome.steps.into(),
                outcome.evaluations.into(),
                timing.minimum.into(),
                timing.median.into(),
                (high - low).into(),
                timing.repeats.into(),
                outcome.error.into(),
                outcome.end_error.into(),
                outcome.tip_error.into(),
                outcome.energy_drift.into(),
                Field::Text(if outcome.diverged.is_some() {
                    "diverged"
                } else {
                    "finished"
                }),
                data.scene.uncertainty().into(),
            ]);
        }
    }
    csv
}

/// A method and its cost, and the next best.
type Best = (Method, Cost, Option<(Method, Cost)>);

/// The method that reaches `target` with the fewest evaluations, its cost, and the next best.
fn best(data: &Data, target: f64) -> Option<Best> {
    let mut reached: Vec<(Method, Cost)> = Method::ALL
        .into_iter()
        .filter_map(|method| Some((method, data.reaching(method, target)?)))
        .collect();
    reached.sort_by(|a, b| a.1.evaluations.total_cmp(&b.1.evaluations));
    let mut reached = reached.into_iter();
    let (method, cost) = reached.next()?;
    Some((method, cost, reached.next()))
}
