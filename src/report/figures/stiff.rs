//! Cost of an error by stiffness: explicit methods compared with implicit baselines.
//!
//! **Invariant:** a run that would take too many steps is shown as a prediction, and labelled so.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::stiff::{DURATION, Solver, StiffScene};
use crate::report::experiments::task::RunOutcome;
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Point, Unit, number, power, scientific};
use crate::report::timing::time;
use crate::study::matrix::largest;

/// The allowed error \[rad\].
const TARGET: f64 = 1e-4;

/// Resolution of the search for the fewest steps: one in this many.
const RESOLUTION: u64 = 16;

/// The cheapest run of a solver within the error, and its time \[s\].
struct Cost {
    ratio: f64,
    solver: Solver,
    run: Option<(RunOutcome, f64)>,
    /// Fewest steps that stability requires.
    fewest: Option<f64>,
}

pub(super) fn make(section: &mut Section) {
    let most = section.choose(1 << 19, 1 << 15);
    let stride = section.choose(1, 2);
    let timed = section.choose(0.03, 0.005);
    let (mut costs, mut uncertainty) = (Vec::new(), 0.0_f64);
    for exponent in (0..=8).step_by(stride) {
        let scene = StiffScene::new(10_f64.powi(exponent));
        let task = &scene.task;
        uncertainty = uncertainty.max(task.uncertainty);
        costs.extend(Solver::ALL.map(|solver| {
            let fewest = scene.fewest_stable_steps(solver);
            // A run that would be unstable at every allowed number of steps is skipped.
            let is_possible = fewest.is_none_or(|fewest| fewest <= in_f64(most));
            let cheapest = || task.fewest(solver, TARGET, (1, most), RESOLUTION);
            let run = is_possible.then(cheapest).flatten();
            let run = run.map(|run| (run, time(timed, || task.replay(solver, run.steps))));
            Cost {
                ratio: scene.ratio,
                solver,
                run,
                fewest,
            }
        }));
    }
    section.findings.extend(finding(&costs));
    verdicts(section, &costs, uncertainty);
    section.figure(
        "stiff",
        &format!("Cost of {} rad as the arm gets stiffer", power(TARGET.log10())),
        &format!(
            "2 links of 1 m and 1 kg, released from (0.4, -0.3) for {DURATION} s with a brake at the elbow, law in every \
             stage. The run time belongs to the run whose evaluations are shown. Hollow marks: the evaluations at the \
             predicted limit of the method. Implicit midpoint and Rodas3 are baselines of this \
             report and cannot be chosen on the live arm. Their Jacobians are finite differences, whose evaluations \
             are counted. Lines end where more than {most} steps would be needed."
        ),
        &panels(&costs),
    );
}

fn of(costs: &[Cost], solver: Solver) -> impl Iterator<Item = &Cost> {
    costs.iter().filter(move |cost| cost.solver == solver)
}

/// The stiffness from which a baseline takes less time than every explicit method.
fn ends(costs: &[Cost]) -> Option<f64> {
    let fastest = |ratio: f64, baseline: bool| {
        costs
            .iter()
            .filter(|cost| cost.ratio.to_bits() == ratio.to_bits())
            .filter(|cost| cost.solver.is_baseline() == baseline)
            .filter_map(|cost| Some(cost.run?.1))
            .fold(f64::INFINITY, f64::min)
    };
    let mut ratios = of(costs, Solver::Rodas3).map(|cost| cost.ratio);
    ratios.find(|&ratio| fastest(ratio, true) < fastest(ratio, false))
}

fn finding(costs: &[Cost]) -> Option<String> {
    let last = |solver| of(costs, solver).last();
    let implicit = last(Solver::Rodas3)?.run?.0;
    let rk4 = last(Solver::Explicit(Method::Rk4))?;
    let ends = ends(costs).map(|ratio| number(ratio.round()));
    Some(format!(
        "**A 2-link swing of {DURATION} s from (0.4, -0.3), with a brake at the elbow {} times as fast as the swing, \
         costs Rodas3 {} evaluations within {} rad of the true motion, and RK4 at least {}**. Rodas3 is an implicit \
         method and a baseline of the report. RK4 is explicit and needs as many to be stable. From a ratio of {} on \
         an implicit method took the least time here.",
        power(rk4.ratio.log10()),
        implicit.evaluations,
        power(TARGET.log10()),
        scientific(rk4.fewest? * f64::from(Method::Rk4.evaluations())),
        ends.unwrap_or_else(|| "?".to_owned()),
    ))
}

fn verdicts(section: &mut Section, costs: &[Cost], uncertainty: f64) {
    let runs = of(costs, Solver::Rodas3).map(|cost| cost.run);
    let evaluations = runs.map(|run| run.map_or(f64::NAN, |run| in_f64(run.0.evaluations)));
    let evaluations: Vec<f64> = evaluations.collect();
    let least = evaluations.iter().copied().fold(f64::INFINITY, f64::min);
    let seen: Vec<String> = evaluations.iter().copied().map(number).collect();
    section.claim(
        "The cost of Rodas3 hardly depends on stiffness (at most fourfold from 1 to 10⁸)",
        format!("{} evaluations", seen.join(", ")),
        largest(evaluations.into_iter()) <= 4.0 * least,
    );
    // Where accuracy requires more steps than stability, the stability limit is not tested.
    let bound = costs
        .iter()
        .filter(|cost| cost.fewest.is_some_and(|fewest| fewest > 100.0));
    let least = bound
        .filter_map(|cost| Some(in_f64(cost.run?.0.steps) / cost.fewest?))
        .fold(f64::INFINITY, f64::min);
    section.claim(
        "No explicit method keeps within the error with fewer than 0.95 times the steps that its predicted limit \
         requires, hanging with the elbow as at the start",
        format!("{} of them at least", number(least)),
        least > 0.95,
    );
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

/// Evaluations and run time.
fn panels(costs: &[Cost]) -> [Plot; 2] {
    let panel = |what: &str, y| {
        let x = "stiffness ratio: the elbow's rate per the swing's";
        let x = Axis::log(x, Unit::Number, (0.5, 2e8));
        Plot::new(what, x, y)
    };
    let y = Axis::log("evaluations of the dynamics", Unit::Number, (10.0, 1e10));
    let mut evaluations = panel("Evaluations", y);
    let mut times = panel(
        "Run time",
        Axis::log("run time", Unit::Seconds, (1e-6, 1.0)),
    );
    for solver in Solver::ALL {
        let name = solver.name();
        let key = match solver {
            Solver::Explicit(method) => Key::of(method),
            Solver::ImplicitMidpoint => Key::line("soft", name).marked(Marker::Down),
            Solver::Rodas3 => Key::line("ink", name).marked(Marker::Plus),
        };
        let runs = || of(costs, solver).filter_map(|cost| Some((cost.ratio, cost.run?)));
        let counted = runs().map(|(ratio, (run, _))| (ratio, in_f64(run.evaluations)));
        evaluations.add(Curve::line(key.clone(), counted));
        let timed = runs().map(|(ratio, (_, time))| (ratio, time));
        times.add(Curve::line(key, timed));
        if let Solver::Explicit(method) = solver {
            let least = of(costs, solver).filter_map(|cost| {
                Some((cost.ratio, cost.fewest? * f64::from(method.evaluations())))
            });
            evaluations.add(Curve::line(Key::predicted(method), least));
        }
    }
    let key = Key::line("soft", "required for stability, predicted").dashed();
    evaluations.add(Curve::line(key, Vec::<Point>::new()));
    [evaluations, times]
}
