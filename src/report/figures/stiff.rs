//! Cost of an error by stiffness, explicit methods beside implicit baselines.
//!
//! **Invariant:** what was not run because it would take too many steps is shown as a prediction, and said to be one.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::stiff::{By, DURATION, OUTPUTS, Solver, StiffRun, StiffScene};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, power, scientific, seconds,
};
use crate::report::timing::{Effort, Timing, time};
use crate::study::fewest::StepSearch;

/// The error that is to be kept \[rad\].
const TARGET: f64 = 1e-4;

/// The fewest steps are found to this part of them.
const RESOLUTION: u64 = 16;

const FAMILIES: [(By, &str); 2] = [
    (By::Gains, "a stronger brake"),
    (By::Masses, "a lighter link"),
];

/// The cheapest run of a solver within the error, or why there is none.
struct CheapestRun {
    by: By,
    ratio: f64,
    solver: Solver,
    run: Option<(StiffRun, Timing)>,
    /// Steps that stability asks for at least.
    fewest: Option<f64>,
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let most = making.choose(1 << 19, 1 << 15);
    let exponents: Vec<i32> = making.choose((0..=8).collect(), vec![0, 2, 4, 6, 8]);
    let effort = Effort {
        least: 3,
        most: 9,
        seconds: making.choose(0.03, 0.005),
    };
    let mut costs = Vec::new();
    let mut uncertainty = 0.0_f64;
    for (by, _) in FAMILIES {
        for exponent in &exponents {
            let scene = StiffScene::new(by, 10_f64.powi(*exponent));
            uncertainty = uncertainty.max(scene.uncertainty);
            for solver in Solver::ALL {
                let fewest = scene.fewest_stable_steps(solver);
                let run = cheapest(&scene, solver, fewest, most).map(|run| {
                    let timing = time(effort, || scene.run(solver, run.steps));
                    (run, timing)
                });
                costs.push(CheapestRun {
                    by,
                    ratio: scene.ratio,
                    solver,
                    run,
                    fewest,
                });
            }
        }
    }
    section(making, &costs, uncertainty)
}

/// The run within the error with the fewest steps, found to a part of [`RESOLUTION`]. One that stability forbids for
/// all that may be taken is not begun.
fn cheapest(
    scene: &StiffScene,
    solver: Solver,
    fewest: Option<f64>,
    most: u64,
) -> Option<StiffRun> {
    if fewest.is_some_and(|fewest| fewest > in_f64(most)) {
        return None;
    }
    // A run is compared at the outputs: its steps are a multiple of them.
    let mut search = StepSearch::new(1, most / OUTPUTS).to_part(RESOLUTION);
    let mut best = None;
    while let Some(steps) = search.wanted() {
        let run = scene.run(solver, OUTPUTS * steps);
        let is_enough = run.error <= TARGET;
        if is_enough {
            best = Some(run);
        }
        search.tell(is_enough);
    }
    best
}

fn section(making: &mut Making<'_>, costs: &[CheapestRun], uncertainty: f64) -> Section {
    let mut csv = Csv::new(
        "stiffened_by,ratio,solver,steps,evaluations,error_rad,time_s,fewest_stable_steps",
    );
    for cost in costs {
        csv.row(&[
            words(cost.by).into(),
            cost.ratio.into(),
            cost.solver.name().into(),
            cost.run.map(|run| run.0.steps).into(),
            cost.run.map(|run| run.0.evaluations).into(),
            cost.run.map(|run| run.0.error).into(),
            cost.run.map(|run| run.1.minimum).into(),
            cost.fewest.into(),
        ]);
    }
    making.keep("stiff", csv);
    let ends = ends(costs, By::Gains);
    Section {
        findings: finding(costs, ends).into_iter().collect(),
        verdicts: verdicts(costs, uncertainty),
        blocks: vec![Block::Figure(figure(costs))],
        ..Section::default()
    }
}

fn words(by: By) -> &'static str {
    FAMILIES
        .iter()
        .find(|family| family.0 == by)
        .map_or("", |family| family.1)
}

fn of(costs: &[CheapestRun], by: By, solver: Solver) -> impl Iterator<Item = &CheapestRun> {
    costs
        .iter()
        .filter(move |cost| cost.by == by && cost.solver == solver)
}

/// The stiffness from which a baseline takes less time than every explicit method.
fn ends(costs: &[CheapestRun], by: By) -> Option<f64> {
    let fastest = |ratio: f64, baseline: bool| {
        costs
            .iter()
            .filter(|cost| cost.by == by && cost.ratio.to_bits() == ratio.to_bits())
            .filter(|cost| cost.solver.is_baseline() == baseline)
            .filter_map(|cost| Some(cost.run?.1.minimum))
            .fold(f64::INFINITY, f64::min)
    };
    of(costs, by, Solver::Rodas3)
        .map(|cost| cost.ratio)
        .find(|&ratio| fastest(ratio, true) < fastest(ratio, false))
}

fn finding(costs: &[CheapestRun], ends: Option<f64>) -> Option<String> {
    let last = |solver| of(costs, By::Gains, solver).last();
    let implicit = last(Solver::Rodas3)?.run?;
    let rk4 = last(Solver::Explicit(Method::Rk4))?;
    Some(format!(
        "**An explicit method pays for stiffness, an implicit one does not**: to stay within {} rad of the true \
         motion on a swing of {DURATION} s with a brake at the elbow, Rodas3 (a baseline of this report) \
         takes {} evaluations at a stiffness ratio of {}, where RK4 would need {} steps to be stable at all. From a \
         ratio of {} on an implicit method is the faster one.",
        power(TARGET.log10().round()),
        implicit.0.evaluations,
        power(rk4.ratio.log10().round()),
        scientific(rk4.fewest?),
        ends.map_or_else(|| "?".to_owned(), |ratio| number(ratio.round())),
    ))
}

fn verdicts(costs: &[CheapestRun], uncertainty: f64) -> Vec<Verdict> {
    let flat = FAMILIES.into_iter().all(|(by, _)| {
        let all: Vec<_> = of(costs, by, Solver::Rodas3).map(|cost| cost.run).collect();
        let most = all.iter().flatten().map(|run| run.0.evaluations).max();
        let fewest = all.iter().flatten().map(|run| run.0.evaluations).min();
        all.iter().all(Option::is_some) && most <= fewest.map(|fewest| 4 * fewest)
    });
    let explicit = || costs.iter().filter(|cost| !cost.solver.is_baseline());
    // Where it is accuracy that asks for steps, stability has nothing to say.
    let least = explicit()
        .filter_map(|cost| Some((in_f64(cost.run?.0.steps), cost.fewest?)))
        .filter(|(_, fewest)| *fewest > 100.0)
        .map(|(steps, fewest)| steps / fewest)
        .fold(f64::INFINITY, f64::min);
    vec![
        Verdict {
            claim: "The cost of Rodas3 hardly depends on stiffness (at most fourfold from 1 to 10⁸)".to_owned(),
            seen: format!(
                "{} evaluations",
                of(costs, By::Gains, Solver::Rodas3)
                    .map(|cost| cost.run.map_or_else(|| "none".to_owned(), |run| run.0.evaluations.to_string()))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
            holds: flat,
        },
        Verdict {
            claim: "No explicit method keeps the error with fewer than 0.7 of the steps that its predicted limit asks \
             for, which is that of the hanging pose".to_owned(),
            seen: format!("{} of them at least", number(least)),
            holds: least > 0.7,
        },
        Verdict {
            claim: format!("The references are known to a hundredth of {} rad", power(TARGET.log10().round())),
            seen: format!("two of different methods are {} rad apart at most", scientific(uncertainty)),
            holds: uncertainty <= 0.01 * TARGET,
        },
    ]
}

fn class(solver: Solver) -> (&'static str, Marker) {
    match solver {
        Solver::Explicit(method) => (method.name(), Marker::of(method)),
        Solver::ImplicitMidpoint => ("soft", Marker::Square),
        Solver::Rodas3 => ("ink", Marker::Circle),
    }
}

fn figure(costs: &[CheapestRun]) -> Figure {
    let plots: Vec<Plot> = FAMILIES
        .into_iter()
        .flat_map(|family| panels(costs, family))
        .collect();
    let mut keys: Vec<Key> = Solver::ALL
        .into_iter()
        .map(|solver| {
            let (class, marker) = class(solver);
            Key {
                class,
                marker,
                dashed: false,
                label: solver.name().to_owned(),
            }
        })
        .collect();
    keys.push(Key {
        dashed: true,
        ..Key::line("soft", "what stability asks for, predicted")
    });
    Figure::new(
        "stiff",
        format!(
            "Cost of {} rad as the arm gets stiffer",
            power(TARGET.log10().round())
        ),
        format!(
            "2 links let go from (0.4, -0.3) for {DURATION} s with a brake at the elbow, law in every stage. Run time \
             is that of the run whose evaluations are shown. Implicit midpoint and Rodas3 are baselines \
             of this report and cannot be chosen on the live arm; their Jacobians are taken by differences, and \
             counted. Lines end where more than half a million steps would be needed."
        ),
        &keys,
        &plots,
    )
}

/// Evaluations and run time of one family.
fn panels(costs: &[CheapestRun], (by, words): (By, &str)) -> [Plot; 2] {
    let panel = |what: &str, y| {
        let x = "stiffness ratio: the elbow's rate per the swing's";
        let x = Axis::log_between(x, Unit::Number, 0.5, 2e8);
        Plot::new(format!("Stiff by {words}: {what}"), x, y)
    };
    let y = Axis::log_between("evaluations of the dynamics", Unit::Number, 10.0, 1e10);
    let mut evaluations = panel("evaluations", y);
    let y = Axis::log_between("run time", Unit::Seconds, 1e-6, 1.0);
    let mut times = panel("run time", y);
    for solver in Solver::ALL {
        let (class, marker) = class(solver);
        let line = |points: Vec<Point>, dashed| Curve {
            class,
            marker: if dashed { Marker::None } else { marker },
            line: true,
            dashed,
            points,
        };
        let (mut counted, mut timed, mut predicted) = (vec![], vec![], vec![]);
        for cost in of(costs, by, solver) {
            if let Some((run, timing)) = &cost.run {
                let count = in_f64(run.evaluations);
                let tooltip = format!("{}: {}", solver.name(), run.evaluations);
                counted.push(Point::new(cost.ratio, count, tooltip));
                let tooltip = format!("{}: {}", solver.name(), seconds(timing.minimum));
                timed.push(Point::new(cost.ratio, timing.minimum, tooltip));
            }
            if let (Some(fewest), Solver::Explicit(method)) = (cost.fewest, solver) {
                let least = fewest * f64::from(method.evaluations());
                predicted.push(Point::new(cost.ratio, least, ""));
            }
        }
        evaluations.series.push(line(counted, false));
        evaluations.series.push(line(predicted, true));
        times.series.push(line(timed, false));
    }
    [evaluations, times]
}
