//! Cost of an error by stiffness: an explicit method compared with implicit baselines.
//!
//! **Invariant:** a run that would take too many steps is shown as a prediction, and labelled so.

use crate::math::count::{in_f64, whole};
use crate::math::integrator::Method;
use crate::report::experiments::solvers::Solver;
use crate::report::experiments::stiff::{DURATION, StiffScene, Stiffness};
use crate::report::experiments::task::RunOutcome;
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Point, Unit, number, power, scientific};
use crate::report::timing::{Time, time};
use crate::study::matrix::largest;

/// The allowed error \[rad\].
const TARGET: f64 = 1e-4;

/// Resolution of the search for the fewest steps: one in this many.
const RESOLUTION: u64 = 16;

/// The solvers of the figure; RK4 is the first.
const SOLVERS: [Solver; 3] = [
    Solver::Fixed(Method::Rk4),
    Solver::ImplicitMidpoint,
    Solver::Rodas3,
];

/// Ratios of the scenes, as powers of ten. Beyond the last the references are no longer known.
const LAST_POWER: i32 = 6;

/// A scene with the cheapest run of each solver within the error, and its time.
struct Cost {
    scene: StiffScene,
    runs: [Option<(RunOutcome, Time)>; SOLVERS.len()],
    /// Fewest evaluations of RK4 that stability requires.
    required: Option<f64>,
}

impl Cost {
    fn new(stiffness: Stiffness, ratio: f64, most: u64) -> Self {
        let scene = StiffScene::new(stiffness, ratio);
        let task = &scene.task;
        let runs = SOLVERS.map(|solver| {
            let fewest = scene.fewest_stable_steps(&solver);
            // A run that would be unstable at every allowed number of steps is skipped.
            let is_possible = fewest.is_none_or(|fewest| fewest <= in_f64(most));
            let cheapest = || task.fewest(solver.clone(), TARGET, (1, most), RESOLUTION);
            let run = is_possible.then(cheapest).flatten()?;
            Some((run, time(|| task.replay(solver.clone(), run.steps))))
        });
        let [rk4, ..] = &SOLVERS;
        let steps = scene.fewest_stable_steps(rk4);
        Self {
            required: steps.map(|steps| steps * f64::from(Method::Rk4.evaluations())),
            runs,
            scene,
        }
    }

    /// Whether an implicit method takes at most half the time of RK4. Near the time of RK4 the order of the two is chance.
    fn is_implicit_faster(&self) -> bool {
        let [rk4, midpoint, rodas3] =
            (self.runs).map(|run| run.map_or(f64::INFINITY, |run| run.1.median));
        2.0 * midpoint.min(rodas3) <= rk4
    }
}

/// The names of the scenes in the report.
const fn name(stiffness: Stiffness) -> &'static str {
    match stiffness {
        Stiffness::Brake => "brake",
        Stiffness::Spring => "spring",
        Stiffness::LightLink => "light last link",
        Stiffness::Controller => "controller",
    }
}

pub(super) fn make(section: &mut Section) {
    let most = section.choose(1 << 17, 1 << 14);
    let stride = section.choose(1, 2);
    let all = Stiffness::ALL.map(|stiffness| {
        let ratios = (0..=LAST_POWER)
            .step_by(stride)
            .map(|power| 10_f64.powi(power));
        let costs = ratios.map(|ratio| Cost::new(stiffness, ratio, most));
        (stiffness, costs.collect::<Vec<_>>())
    });
    let spring = StiffScene::new(Stiffness::Spring, ENERGY_RATIO);
    section.findings.extend(finding(&all, &spring));
    verdicts(section, &all);
    let panels: Vec<Plot> = all
        .iter()
        .map(|(stiffness, costs)| evaluations(name(*stiffness), costs))
        .chain([times(&all), energies(&spring)])
        .collect();
    section.figure(
        "stiff",
        &format!("Cost of {} rad as an elbow gets stiffer", power(TARGET.log10())),
        &format!(
            "2 links of 1 m and 1 kg, released from (0.4, -0.3) for {DURATION} s, law in every stage. The elbow has a \
             brake; an undamped spring; a last link of less mass under fixed gains; a critically damped controller. \
             Spring and controller begin at 0.001 rad/s. The ratio is the elbow's own rate per that of the \
             swing, hanging. Hollow marks: the evaluations of RK4 at its predicted limit. Run times are medians and \
             belong to the runs whose evaluations are shown. Last panel: the energy of the spring's fast motion after \
             {DURATION} s. Its true value is 1. Implicit midpoint and Rodas3 are baselines of this report. Their \
             Jacobians are finite differences, whose evaluations are counted. Lines end where more than {most} steps \
             would be needed.",
        ),
        &panels,
    );
}

/// All costs of a kind of stiffness, by ratio.
type Costs = (Stiffness, Vec<Cost>);

/// The steps per period of the fast motion, for the panel of energies.
const STEPS_PER_PERIOD: std::ops::RangeInclusive<i32> = -8..=16;

/// The ratio of that panel.
const ENERGY_RATIO: f64 = 1000.0;

/// The parts of the energy that remain with a number of steps per period, for each solver.
fn remaining(scene: &StiffScene, per_period: f64) -> [f64; SOLVERS.len()] {
    let [rk4, ..] = &SOLVERS;
    // RK4 is stable up to √8 radians of an oscillation per step.
    let radians = 8_f64.sqrt() * scene.fewest_stable_steps(rk4).unwrap_or(f64::NAN);
    let steps = (per_period * radians / std::f64::consts::TAU).ceil();
    SOLVERS.map(|solver| scene.fast_energy(solver, whole(steps).max(1)))
}

fn energies(spring: &StiffScene) -> Plot {
    let x = Axis::log(
        "steps per period of the fast motion",
        Unit::Number,
        (0.1, 100.0),
    );
    let y = Axis::linear("energy left of the fast motion", (0.0, 1.25));
    let plot = Plot::new(format!("Spring, ratio {ENERGY_RATIO}"), x, y);
    let counts = STEPS_PER_PERIOD.map(|eighth| 10_f64.powf(0.125 * f64::from(eighth)));
    let points: Vec<(f64, [f64; 3])> = counts.map(|it| (it, remaining(spring, it))).collect();
    plot.with((0..SOLVERS.len()).map(|index| {
        let of = |(x, parts): &(f64, [f64; 3])| Some((*x, *parts.get(index)?));
        Curve::line(key(index), points.iter().filter_map(of))
    }))
}

fn key(index: usize) -> Key {
    match index {
        0 => Key::of(Method::Rk4),
        1 => Key::line("soft", "implicit midpoint").marked(Marker::Down),
        _ => Key::line("ink", "Rodas3").marked(Marker::Plus),
    }
}

const RATIO: &str = "stiffness ratio: the elbow's rate per the swing's";

fn ratios() -> Axis {
    Axis::log(RATIO, Unit::Number, (0.5, 2e6))
}

/// A line for each solver.
fn lines(plot: Plot, costs: &[Cost], value: impl Fn(&RunOutcome, &Time) -> f64) -> Plot {
    let line = |index: usize| {
        let points = costs.iter().filter_map(|cost| {
            let (run, time) = cost.runs.get(index)?.as_ref()?;
            Some((cost.scene.ratio, value(run, time)))
        });
        Curve::line(key(index), points)
    };
    plot.with((0..SOLVERS.len()).map(line))
}

fn evaluations(name: &str, costs: &[Cost]) -> Plot {
    let y = Axis::log("evaluations of the dynamics", Unit::Number, (10.0, 1e8));
    let plot = Plot::new(format!("Stiff by its {name}"), ratios(), y);
    let required = costs.iter();
    let required = required.filter_map(|cost| Some((cost.scene.ratio, cost.required?)));
    let label = Key::line("soft", "required for stability, predicted").dashed();
    lines(plot, costs, |run, _| in_f64(run.evaluations)).with([
        Curve::line(Key::predicted(Method::Rk4), required),
        Curve::line(label, Vec::<Point>::new()),
    ])
}

fn times(all: &[Costs]) -> Plot {
    let y = Axis::log("run time", Unit::Seconds, (1e-5, 1.0));
    let spring = all.iter().find(|it| it.0 == Stiffness::Spring);
    let plot = Plot::new("Run time with the spring", ratios(), y);
    let costs = spring.map_or(&[][..], |it| &it.1);
    lines(plot, costs, |_, time| time.median)
}

fn finding(all: &[Costs], spring: &StiffScene) -> Option<String> {
    let last = all.first()?.1.last()?;
    let [_, _, rodas3] = last.runs;
    let wins = all.iter().map(|(stiffness, costs)| {
        let first = costs.iter().find(|cost| cost.is_implicit_faster());
        let ratio = first.map(|cost| number(cost.scene.ratio.round()));
        format!(
            "{} with the {}",
            ratio.unwrap_or_else(|| "no ratio".to_owned()),
            name(*stiffness)
        )
    });
    let wins = wins.collect::<Vec<_>>().join(", ");
    let [rk4, midpoint, damped] = remaining(spring, 4.0).map(|part| 100.0 * part);
    Some(format!(
        "**A 2-link swing of {DURATION} s from (0.4, -0.3), with a brake at the elbow {} times as fast as the swing, \
         costs Rodas3 {} evaluations within {} rad of the true motion, and RK4 at least {}**. Rodas3 is an implicit \
         method and a baseline of the report. RK4 is explicit and needs as many to be stable. An implicit method took \
         at most half the time of RK4 here from a ratio of {wins}. With 4 steps per period of an undamped spring, implicit midpoint \
         keeps {} % of the energy of its motion, at a wrong frequency. RK4 and Rodas3 keep at most {} %.",
        power(last.scene.ratio.log10()),
        rodas3?.0.evaluations,
        power(TARGET.log10()),
        scientific(last.required?),
        number(midpoint),
        scientific(rk4.max(damped)),
    ))
}

fn verdicts(section: &mut Section, all: &[Costs]) {
    let costs = || all.iter().flat_map(|it| &it.1);
    let brake = all.iter().filter(|it| it.0 == Stiffness::Brake);
    let runs = brake.flat_map(|it| &it.1).map(|cost| cost.runs[2]);
    let evaluations = runs.map(|run| run.map_or(f64::NAN, |run| in_f64(run.0.evaluations)));
    let evaluations: Vec<f64> = evaluations.collect();
    let least = evaluations.iter().copied().fold(f64::INFINITY, f64::min);
    let seen: Vec<String> = evaluations.iter().copied().map(number).collect();
    section.claim(
        format!(
            "With the brake the cost of Rodas3 hardly depends on stiffness (at most fourfold from 1 to {})",
            power(f64::from(LAST_POWER))
        ),
        format!("{} evaluations", seen.join(", ")),
        largest(evaluations.into_iter()) <= 4.0 * least,
    );
    let parts = costs().filter_map(|cost| {
        let [rk4, ..] = &cost.runs;
        Some(in_f64(rk4.as_ref()?.0.evaluations) / cost.required?)
    });
    let least = parts.fold(f64::INFINITY, f64::min);
    section.claim(
        "RK4 never keeps within the error with fewer than 0.95 times the steps that its predicted limit requires, hanging \
         with the elbow as at the start",
        format!("{} of them at least", number(least)),
        least > 0.95,
    );
    let uncertainty = largest(costs().map(|cost| cost.scene.task.uncertainty));
    section.claim(
        format!(
            "The references are known to a hundredth of {} rad",
            power(TARGET.log10())
        ),
        format!(
            "two of different methods are {} rad apart at most",
            scientific(uncertainty)
        ),
        uncertainty <= 0.01 * TARGET,
    );
}
