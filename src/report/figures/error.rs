//! Error against time, evaluations and timestep, in every scene and for every method.
//!
//! **Invariant:** every time is shown with the error of the same steps. Runs that are lost are drawn as lost, and no
//! value is interpolated between two runs.

use std::sync::Arc;

use super::fit::slope;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::error::{OUTPUTS, REACH, Scene, scenes};
use crate::report::experiments::solvers::{Explicit, Solver};
use crate::report::experiments::task::{LOST, RunOutcome, Task};
use crate::report::section::Section;
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, power, scientific, seconds,
};
use crate::report::timing::{RUNS, Time, time};
use crate::study::matrix::largest;
use crate::study::tableau::Pair;

/// Range of errors for a slope's fit \[rad\]: above it higher orders matter, below it rounding.
const ASYMPTOTIC: std::ops::Range<f64> = 1e-11..1e-3;

/// Resolution of the search for the fewest steps: one in this many.
const RESOLUTION: u64 = 256;

/// Most steps of that search.
const MOST_STEPS: u64 = 1 << 21;

/// Most halvings of the longest timestep of a baseline: an implicit step takes a microsecond.
const HALVINGS: u32 = 9;

/// Most steps that a solver with a tolerance may try.
const MOST_TRIED: u64 = 1 << 12;

/// The lower end of the axis of errors \[rad\].
const LEAST_SHOWN: f64 = 1e-17;

/// The scenes in words, for both figures.
const SETTING: &str = "Links of 1 m and 1 kg move for 2 s under gravity of 9.81 m/s², from rest on the horizontal. The whirl \
     is without gravity: 2 links start at (0, 0.5), and the first joint turns at 10 rad/s. Reaches are of 2 links to \
     (0.8, -0.6) with kp 200, 100, ki 0 and kd 30, 12. The error is the largest of all joints and instants. For a reach \
     it is the distance from the loop with a continuous-time law. One mark per timestep: 2 s in 64 steps, in twice as \
     many, and so on, the same for all methods. A cross at the top edge is a run that diverged.";

/// The baselines in words.
const BASELINES: &str = "Baselines, for the free swing of 2 links only: semi-implicit Euler, implicit midpoint and Rodas3 \
     in equal steps; Dormand-Prince 5, DOP853 and the Taylor series of this program's references, with a mark for each \
     tolerance. An evaluation of a Taylor series is one coefficient. The coefficients of tableaus are data, and implicit \
     methods solve their equations by general elimination, so their times have more overhead than those of the four \
     methods. None of the baselines can be chosen on the live arm.";

/// A scene with its runs.
struct Data {
    scene: Scene,
    /// For each of [`Method::ALL`], runs with the timestep halved each time.
    runs: [Vec<Run>; 4],
}

struct Run {
    outcome: RunOutcome,
    /// The time of its steps.
    time: Time,
}

/// The runs of a baseline, coarse to fine, and its look.
type Baseline = (Key, Vec<Run>);

pub(super) fn make(section: &mut Section) {
    let halvings = section.choose(12, 8);
    let scenes = scenes().into_iter();
    let data: Vec<Data> = scenes.map(|scene| Data::new(scene, halvings)).collect();
    let baselines = baselines(section, &data, halvings.min(HALVINGS));
    findings(section, &data);
    adaptive(section, &data, &baselines);
    verdicts(section, &data);
    against_cost(section, &data, &baselines);
    against_timestep(section, &data);
}

/// The baselines on the free swing of 2 links, which is the first scene.
fn baselines(section: &Section, data: &[Data], halvings: u32) -> Vec<Baseline> {
    let Some(swing) = data.first() else {
        return Vec::new();
    };
    let (mut all, task) = (Vec::new(), &swing.scene.task);
    let mut add = |class, marker, label: &str, runs: &mut dyn Iterator<Item = (Solver, u64)>| {
        let runs = runs.map(|(solver, steps)| Run::of(task, &solver, steps));
        let key = Key::line(class, label).marked(marker).dashed();
        all.push((key, runs.collect()));
    };
    let equal = |solver: Solver| {
        let steps = (0..=halvings).map(|halving| OUTPUTS << halving);
        steps.map(move |steps| (solver.clone(), steps))
    };
    let explicit = |pair| equal(Solver::Explicit(Arc::new(Explicit::new(pair))));
    let tolerances = || (4..=28).map(|half| 10_f64.powf(-0.5 * f64::from(half)));
    let semi_implicit = &mut explicit(Pair::semi_implicit());
    let midpoint = &mut equal(Solver::ImplicitMidpoint);
    let taylor = &mut tolerances().map(|tolerance| (Solver::Taylor(tolerance), MOST_TRIED));
    add("c3", Marker::Circle, "semi-implicit Euler", semi_implicit);
    add("soft", Marker::Down, "implicit midpoint", midpoint);
    add("soft", Marker::Plus, "Rodas3", &mut equal(Solver::Rodas3));
    add("c4", Marker::Triangle, "Taylor series, adaptive", taylor);
    let order5 = (
        Marker::Square,
        "Dormand-Prince 5, adaptive",
        Explicit::dormand_prince5(),
    );
    let order8 = (Marker::Diamond, "DOP853, adaptive", Explicit::dop853());
    for (marker, label, method) in [order5, order8] {
        let Some(method) = method.map(Arc::new) else {
            continue;
        };
        let within = |tolerance| (Solver::Adaptive(method.clone(), tolerance), MOST_TRIED);
        add("ink", marker, label, &mut tolerances().map(within));
    }
    if let Some((name, pair)) = &section.own {
        add("c2", Marker::Plus, name, &mut explicit(pair.clone()));
    }
    all
}

impl Data {
    fn new(scene: Scene, halvings: u32) -> Self {
        let runs = Method::ALL.map(|method| {
            let steps = (0..=halvings).map(|halving| OUTPUTS << halving);
            steps
                .map(|steps| Run::of(&scene.task, &method.into(), steps))
                .collect()
        });
        Self { scene, runs }
    }

    fn all(&self) -> impl Iterator<Item = &Run> {
        self.runs.iter().flatten()
    }

    fn of(&self, method: Method) -> impl DoubleEndedIterator<Item = &Run> {
        self.runs.get(method as usize).into_iter().flatten()
    }

    /// The run of a method that keeps within `error` with the fewest steps.
    fn cost(&self, method: Method, error: f64) -> Option<RunOutcome> {
        let task = &self.scene.task;
        task.fewest(method, error, (1, MOST_STEPS), RESOLUTION)
    }

    fn order(&self, method: Method) -> Option<f64> {
        let inside = self
            .of(method)
            .map(|run| (run.outcome.timestep, run.outcome.error))
            .filter(|run| ASYMPTOTIC.contains(&run.1));
        // The four smallest timesteps: near the stability limit an error decreases faster than by its order.
        slope(inside.rev().take(4))
    }
}

impl Run {
    fn of(task: &Task, solver: &Solver, steps: u64) -> Self {
        Self {
            outcome: task.run(solver.clone(), steps, LOST),
            time: time(|| task.replay(solver.clone(), steps)),
        }
    }

    fn evaluations(&self) -> f64 {
        in_f64(self.outcome.evaluations)
    }

    fn at_time(&self) -> (f64, Option<(f64, f64)>) {
        (self.time.median, Some(self.time.spread))
    }

    fn at_evaluations(&self) -> (f64, Option<(f64, f64)>) {
        (self.evaluations(), None)
    }

    fn at_timestep(&self) -> (f64, Option<(f64, f64)>) {
        (self.outcome.timestep, None)
    }
}

/// The x of a run, and its spread.
type Place = fn(&Run) -> (f64, Option<(f64, f64)>);

fn of<'a>(data: &'a [Data], name: &str) -> Option<&'a Data> {
    data.iter().find(|data| data.scene.name == name)
}

/// The panel of a scene. All share the error axis, so that scenes can be compared.
fn plot(data: &Data, x: &Axis, place: Place) -> Plot {
    let y = Axis::log("largest error [rad]", Unit::Number, (LEAST_SHOWN, 10.0));
    let mut plot = Plot::new(data.scene.title, x.clone(), y);
    let rounding = Key::line("soft", "rounding: one unit in the last place of 1 rad").dashed();
    let ends = [x.min, x.max].map(|x| (x, f64::EPSILON));
    plot.add(Curve::line(rounding, ends));
    let methods = Method::ALL.iter().zip(&data.runs);
    plot.with(methods.map(|(method, runs)| curve(Key::of(*method), runs, place)))
}

fn curve(key: Key, runs: &[Run], place: Place) -> Curve {
    let points = runs.iter().map(|run| {
        let RunOutcome {
            timestep,
            error,
            evaluations,
            ..
        } = run.outcome;
        let timestep = seconds(timestep);
        let note = format!("dt {timestep} in {}, {evaluations} evaluations", run.time);
        let (x, spread) = place(run);
        // An error of exactly 0 has no logarithm: it is drawn at the lower edge.
        let point = Point::new(x, error.max(LEAST_SHOWN), note);
        Point { spread, ..point }
    });
    Curve::line(key, points)
}

/// The largest of all times, relative to the median of its runs, below which nine of ten runs lie.
fn widest<'a>(runs: impl Iterator<Item = &'a Run>) -> f64 {
    largest(runs.map(|run| run.time.spread.1 / run.time.median))
}

/// The free swing of 2 links with the baselines, against time and evaluations, and the other scenes against time.
fn against_cost(section: &mut Section, data: &[Data], baselines: &[Baseline]) {
    let Some((swing, others)) = data.split_first() else {
        return;
    };
    let beside = || baselines.iter().flat_map(|baseline| &baseline.1);
    let all = || data.iter().flat_map(Data::all).chain(beside());
    let times = all().map(|run| run.time.median);
    let x = Axis::around("time for the whole run", Unit::Seconds, times);
    let counts = swing.all().chain(beside()).map(Run::evaluations);
    let evaluations = Axis::around("evaluations of the dynamics", Unit::Number, counts);
    let first = [
        ("time", &x, Run::at_time as Place),
        ("evaluations", &evaluations, Run::at_evaluations),
    ];
    let first = first.map(|(what, x, place)| {
        let curves = baselines
            .iter()
            .map(|(key, runs)| curve(key.clone(), runs, place));
        let mut plot = plot(swing, x, place).with(curves);
        plot.title = format!("{}, by {what}", plot.title);
        plot
    });
    let others = others.iter().map(|data| plot(data, &x, Run::at_time));
    let plots: Vec<Plot> = first.into_iter().chain(others).collect();
    section.figure(
        "work-precision-time",
        "On a free swing RK4 needs the least time of the four fixed-step methods; for small errors DOP853 and Taylor series \
         need less",
        &format!(
            "{SETTING} Time is the processor time of one thread on {}, the median of {RUNS} runs. A horizontal line through \
             a mark goes from the time of 10 % of the runs to that of 90 %, at most {} times the median. {BASELINES} Each \
             mark's tooltip has its evaluations.",
            section.processor,
            number(widest(all())),
        ),
        &plots,
    );
}

fn against_timestep(section: &mut Section, data: &[Data]) {
    let all = data.iter().flat_map(Data::all);
    let timesteps = all.map(|run| run.outcome.timestep);
    let x = Axis::around("timestep", Unit::Seconds, timesteps);
    let plots = data.iter().map(|data| {
        let plot = plot(data, &x, Run::at_timestep);
        let ends = [plot.y.min, plot.y.max];
        let limits = data.scene.limits.iter().flat_map(|&(method, limit)| {
            // Limits are almost equal, so each mark has its own height.
            let mark = [(limit, 1e-3 * 0.01_f64.powi(method as i32))];
            let line = Key::predicted(method).marked(Marker::None);
            let line = Curve::line(line, ends.map(|y| (limit, y)));
            [line, Curve::dots(Key::predicted(method), mark)]
        });
        let (corner, key) = (
            x.max / 60.0,
            Key::line("ink", "slopes of orders 1, 2 and 4"),
        );
        let strokes = [1e1, 1e2, 1e4].map(|rise| {
            Curve::line(
                key.clone(),
                [(corner, 1e-14), (10.0 * corner, 1e-14 * rise)],
            )
        });
        plot.with(limits.chain(strokes))
    });
    let plots: Vec<Plot> = plots.collect();
    let held = data.iter().find(|data| data.scene.is_held);
    let order = |method| {
        let order = held.and_then(|data| data.order(method));
        order.map_or_else(|| "?".to_owned(), |order| format!("{order:.2}"))
    };
    section.figure(
        "convergence",
        &format!(
            "Every method converges at its order, unless the effort is held: then RK4's is {} and Verlet's {}",
            order(Method::Rk4),
            order(Method::Verlet)
        ),
        &format!(
            "{SETTING} The slope is the order of the method. Dashed upright lines: the predicted largest stable \
             timestep at the setpoint. Its hollow mark is that of the method."
        ),
        &plots,
    );
}

fn findings(section: &mut Section, data: &[Data]) {
    let swing = of(data, "swing-2");
    let cost = |method| swing.and_then(|swing| swing.cost(method, 1e-4));
    if let (Some(swing), Some(rk4), Some(verlet), Some(euler)) = (
        swing,
        cost(Method::Rk4),
        cost(Method::Verlet),
        cost(Method::Euler),
    ) {
        let each = in_f64(rk4.evaluations);
        let times = |other: RunOutcome| number(in_f64(other.evaluations) / each);
        let duration = swing.scene.task.duration;
        section.findings.push(format!(
            "**Of the four fixed-step methods RK4 is the cheapest on a free 2-link swing of {} s: it keeps within 10⁻⁴ rad of \
             the true motion with steps of {}**. The swing begins at the starting pose. RK4 takes {} evaluations of the \
             dynamics per simulated second. Verlet needs {} times as many, and Euler {} times. This Verlet is a \
             predictor-corrector: it guesses the velocity at the end of a step, and corrects it once.",
            number(duration),
            seconds(rk4.timestep),
            number((each / duration).round()),
            times(verlet),
            times(euler),
        ));
    }
    let held = of(data, "reach-held");
    // 2 s in 2048 steps: the power of two next to the default timestep.
    let at = |method| held.and_then(|held| held.of(method).find(|run| run.outcome.steps == 2048));
    if let (Some(rk4), Some(verlet)) = (at(Method::Rk4), at(Method::Verlet)) {
        section.findings.push(format!(
            "**On a reach with an effort that is held for each step, RK4 is no better than Verlet**. Against a law \
             that acts at every instant, RK4 is {} rad off and Verlet {} rad. The motion is {REACH}, at a timestep of {}.",
            scientific(rk4.outcome.error),
            scientific(verlet.outcome.error),
            seconds(rk4.outcome.timestep)
        ));
    }
}

/// The least of a value over all runs within an error; infinite if there are none.
fn least<'a>(runs: impl Iterator<Item = &'a Run>, error: f64, of: fn(&Run) -> f64) -> f64 {
    let enough = runs.filter(|run| run.outcome.error <= error);
    enough.map(of).fold(f64::INFINITY, f64::min)
}

/// The baselines with a tolerance beside RK4, on the free swing of 2 links.
fn adaptive(section: &mut Section, data: &[Data], baselines: &[Baseline]) {
    const ERRORS: [f64; 2] = [1e-6, 1e-9];
    const SMALL: f64 = 1e-12;
    let Some(swing) = of(data, "swing-2") else {
        return;
    };
    let runs = |label: &str| {
        let found = baselines.iter().find(|it| it.0.label.starts_with(label));
        found.map_or(&[][..], |it| &it.1).iter()
    };
    let duration = swing.scene.task.duration;
    let mut is_fewer = true;
    let told = ERRORS.map(|error| {
        let rk4 = swing.cost(Method::Rk4, error);
        let rk4 = rk4.map_or(f64::NAN, |run| in_f64(run.evaluations));
        let others = ["Dormand", "DOP853", "Taylor"]
            .map(|label| least(runs(label), error, Run::evaluations));
        is_fewer &= others.iter().all(|other| *other < rk4);
        let [dormand_prince5, dop853, taylor] = others.map(|it| number((it / duration).round()));
        format!(
            "within {} rad RK4 takes {} evaluations per simulated second, Dormand-Prince 5 {dormand_prince5}, DOP853 \
             {dop853} and the Taylor series {taylor} coefficients",
            power(error.log10()),
            number((rk4 / duration).round()),
        )
    });
    section.findings.push(format!(
        "**Methods of higher order with a tolerance need fewer evaluations than RK4 for small errors**. On the same swing, \
         {}. They are baselines of the report, at the best of 25 tolerances.",
        told.join("; ")
    ));
    let rk4 = least(swing.of(Method::Rk4), SMALL, |run| run.time.median);
    let others = ["DOP853", "Taylor"].map(|label| least(runs(label), SMALL, |run| run.time.median));
    section.claim(
        format!(
            "On the free swing they need fewer evaluations than RK4 at {}, and DOP853 and Taylor series less time at {} rad",
            ERRORS.map(|error| power(error.log10())).join(" and "),
            power(SMALL.log10())
        ),
        format!("{}; RK4 {}", others.map(seconds).join(" and "), seconds(rk4)),
        is_fewer && others.iter().all(|other| *other < rk4),
    );
}

fn verdicts(section: &mut Section, data: &[Data]) {
    let all = data
        .iter()
        .flat_map(|data| Method::ALL.map(|method| (data, method)));
    let fitted = all.filter_map(|(data, method)| {
        let expected = if data.scene.is_held {
            1.0
        } else {
            f64::from(method.order())
        };
        let order = data.order(method)?;
        let title = data.scene.title;
        Some((
            (order - expected).abs(),
            format!("{method} in {title}, {order:.2} for {expected:.0}"),
        ))
    });
    let furthest = fitted.max_by(|one, other| one.0.total_cmp(&other.0));
    let (off, seen) = furthest.unwrap_or((f64::INFINITY, "no slope fitted".to_owned()));
    section.claim(
        "Every method converges at its order, and at order 1 where the effort is held (slopes within 0.35)",
        format!("furthest off: {seen}"),
        off <= 0.35,
    );
    let errors = data.iter().flat_map(Data::all);
    let errors = errors.map(|run| run.outcome.error);
    let smallest = errors
        .filter(|error| *error > 0.0)
        .fold(f64::INFINITY, f64::min);
    let uncertainty = largest(data.iter().map(|data| data.scene.task.uncertainty));
    section.claim(
        "References are at least 100 times better known than the smallest error shown",
        format!(
            "uncertainty at most {}, smallest error {}",
            scientific(uncertainty),
            scientific(smallest)
        ),
        uncertainty * 100.0 <= smallest,
    );
}
