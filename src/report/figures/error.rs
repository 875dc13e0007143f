//! Error against evaluations, time and timestep, in every scene and for every method.
//!
//! **Invariant:** every time stands beside the error of the same steps; runs that are lost are drawn as lost.

use super::super::Desk;
use super::super::csv::{Csv, Field};
use super::super::section::{Block, Cell, Figure, Section, Table, Verdict};
use super::super::svg::{
    Axis, Key, Mark, Plot, Point, Series, Unit, number, power, scientific, seconds,
};
use super::super::timing::{Effort, Timing, time};
use super::slope;
use crate::math::integrator::Method;
use crate::study::error::{OUTPUTS, Outcome, Scene, scenes};

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

pub(super) fn make(desk: &mut Desk<'_>) -> Section {
    let data = compute(desk);
    desk.keep("work-precision", table_of_runs(&data));
    desk.keep("work-precision-time", table_of_runs(&data));
    desk.keep("convergence", table_of_runs(&data));
    let mut section = Section {
        findings: findings(&data),
        verdicts: verdicts(&data),
        glance: vec![cheapest(&data)],
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

fn compute(desk: &mut Desk<'_>) -> Vec<Data> {
    let halvings = desk.choose(15, 9);
    let effort = desk.choose(
        Effort {
            least: 5,
            most: 25,
            seconds: 0.2,
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
                desk.at(done, of);
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

/// What it takes.
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

/// All panels share this, so that scenes can be compared. An exact hit is drawn on the lower edge.
fn error_axis() -> Axis {
    Axis::log_between("largest error [rad]", Unit::Number, 1e-17, 10.0)
}

fn told(data: &Data, run: &Run) -> String {
    let Outcome {
        timestep,
        evaluations,
        error,
        ..
    } = run.outcome;
    let outcome = if error.is_finite() {
        format!("error {} {}", scientific(error), data.unit())
    } else {
        "diverged".to_owned()
    };
    format!(
        "{}: dt {}, {evaluations} evaluations, {}: {outcome}",
        run.method,
        seconds(timestep),
        seconds(run.timing.minimum)
    )
}

fn panels(data: &[Data], x: Axis, of: impl Fn(&Run) -> f64) -> Vec<Plot> {
    data.iter()
        .map(|data| {
            let mut plot = Plot::new(data.scene.title(), x.clone(), error_axis());
            if data.scene.links() == 0 {
                plot.y.label = "largest error [m]";
            }
            for method in Method::ALL {
                let points = data.of(method).map(|run| {
                    // An error of exactly 0 has no logarithm: it is drawn at the lower edge.
                    let error = run.outcome.error.max(1e-17);
                    Point::new(of(run), error, told(data, run))
                });
                plot.series.push(Series::of(method, points.collect()));
            }
            plot
        })
        .collect()
}

fn against_evaluations(data: &[Data]) -> Figure {
    let all = data.iter().flat_map(|data| &data.runs);
    let x = Axis::log(
        "evaluations of the dynamics",
        Unit::Number,
        all.map(|run| in_f64(run.outcome.evaluations)),
    );
    let mut plots = panels(data, x.clone(), |run| in_f64(run.outcome.evaluations));
    for plot in &mut plots {
        plot.marks.push(Mark::Slopes {
            x: x.min * 1.3,
            y: 1e-10,
            decades: 0.9,
            orders: vec![-1.0, -2.0, -4.0],
        });
        plot.marks.push(floor());
    }
    Figure::new(
        "work-precision",
        headline_evaluations(data),
        "Down and left is better. One mark per timestep, halved from mark to mark; every method takes the same timesteps. \
         Crosses at the top edge are runs that diverged. The three strokes show orders 1, 2 and 4; the dotted line is one unit in \
         the last place of 1 rad.",
        &Key::methods(),
        &plots,
    )
}

fn floor() -> Mark {
    Mark::Horizontal {
        y: f64::EPSILON,
        class: "soft",
        label: "rounding".to_owned(),
    }
}

fn against_time(data: &[Data]) -> Figure {
    let all = data.iter().flat_map(|data| &data.runs);
    let x = Axis::log(
        "time for the whole run",
        Unit::Seconds,
        all.map(|run| run.timing.minimum),
    );
    let mut plots = panels(data, x, |run| run.timing.minimum);
    for (plot, data) in plots.iter_mut().zip(data) {
        plot.above = Some(("real-time factor", data.scene.duration()));
        let points = plot.series.iter_mut().flat_map(|series| &mut series.points);
        let runs = Method::ALL.into_iter().flat_map(|method| data.of(method));
        for (point, run) in points.zip(runs) {
            point.spread = Some(run.timing.quartiles);
        }
        plot.marks.push(floor());
    }
    Figure::new(
        "work-precision-time",
        headline_time(data),
        "As above, with the clock instead of the count: the minimum of repeats, whiskers from first to third quartile. The scale at \
         the top is the real-time factor, simulated time over computing time.",
        &Key::methods(),
        &plots,
    )
}

fn against_timestep(data: &[Data]) -> Figure {
    let all = data.iter().flat_map(|data| &data.runs);
    let x = Axis::log(
        "timestep",
        Unit::Seconds,
        all.map(|run| run.outcome.timestep),
    );
    let mut plots = panels(data, x.clone(), |run| run.outcome.timestep);
    for (plot, data) in plots.iter_mut().zip(data) {
        for method in Method::ALL {
            if let Some(limit) = data.scene.predicted_limit(method) {
                plot.marks.push(Mark::Vertical {
                    x: limit,
                    class: method.name(),
                    told: format!("{method}: predicted stability limit {}", seconds(limit)),
                });
            }
        }
        plot.marks.push(Mark::Slopes {
            x: x.max / 60.0,
            y: 1e-14,
            decades: 1.0,
            orders: vec![1.0, 2.0, 4.0],
        });
        plot.marks.push(floor());
    }
    Figure::new(
        "convergence",
        headline_timestep(data),
        "The slope is the order, until rounding ends it. Dotted upright lines: the predicted largest stable timestep at the setpoint, one per method.",
        &Key::methods(),
        &plots,
    )
}

fn headline_evaluations(data: &[Data]) -> String {
    let (mut won, mut asked) = (0, 0);
    for data in data.iter().filter(|data| data.scene.control() != "held") {
        for target in [1e-4, 1e-6] {
            if let Some((method, ..)) = best(data, target) {
                asked += 1;
                won += usize::from(method == Method::Rk4);
            }
        }
    }
    format!(
        "RK4 needs the fewest evaluations for 10⁻⁴ and 10⁻⁶ in {won} of {asked} cases where the effort is not held"
    )
}

fn headline_time(data: &[Data]) -> String {
    let swing = data.iter().find(|data| data.scene.name() == "swing-2");
    let cost = |method| swing.and_then(|data| data.reaching(method, 1e-6));
    match (cost(Method::Rk4), cost(Method::Verlet), swing) {
        (Some(rk4), Some(verlet), Some(data)) => format!(
            "In time the order is the same: 10⁻⁶ rad costs RK4 {} and Verlet {} for {} s of a free swing",
            seconds(rk4.wall),
            seconds(verlet.wall),
            number(data.scene.duration())
        ),
        _ => "Error against time".to_owned(),
    }
}

fn headline_timestep(data: &[Data]) -> String {
    let held = data.iter().find(|data| data.scene.control() == "held");
    let order = |method| {
        held.and_then(|data| data.order(method))
            .map_or_else(|| "?".to_owned(), |o| format!("{o:.2}"))
    };
    format!(
        "Every method shows its order, until the effort is held: then RK4's is {} and Verlet's {}",
        order(Method::Rk4),
        order(Method::Verlet)
    )
}

/// The method that reaches `target` with the fewest evaluations, its cost, and the next best.
fn best(data: &Data, target: f64) -> Option<(Method, Cost, Option<(Method, Cost)>)> {
    let mut reached: Vec<(Method, Cost)> = Method::ALL
        .into_iter()
        .filter_map(|method| Some((method, data.reaching(method, target)?)))
        .collect();
    reached.sort_by(|a, b| a.1.evaluations.total_cmp(&b.1.evaluations));
    let mut reached = reached.into_iter();
    let (method, cost) = reached.next()?;
    Some((method, cost, reached.next()))
}

fn cheapest(data: &[Data]) -> Table {
    let mut head = vec!["Scene".to_owned()];
    head.extend(TARGETS.map(|target| format!("{} rad", power(target.log10().round()))));
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "cheapest",
        "At a glance: the cheapest method for each error",
        "Fewest evaluations; under it the timestep, and evaluations and computing time for one simulated second; last how \
         many times more evaluations the next best method needs. Between two measured timesteps the values are interpolated. \
         The particle's errors are in m.",
        &head,
    );
    for data in data {
        let mut row = vec![Cell::new(data.scene.title())];
        for target in TARGETS {
            row.push(match best(data, target) {
                None => Cell::new("not reached").class("soft"),
                Some((method, cost, next)) => {
                    let per_second = cost.evaluations / data.scene.duration();
                    let time = seconds(cost.wall / data.scene.duration());
                    let next = next.map_or_else(String::new, |(next, other)| {
                        format!("; {next} ×{}", number(other.evaluations / cost.evaluations))
                    });
                    Cell::method(method).detail(format!(
                        "dt {}; {} evaluations, {time} per s{next}",
                        seconds(cost.timestep),
                        number(per_second.round())
                    ))
                }
            });
        }
        table.rows.push(row);
    }
    table
}

fn orders(data: &[Data]) -> Table {
    let mut table = Table::new(
        "orders",
        "Fitted orders",
        "Slope of error against timestep through the four finest runs between 10⁻¹¹ and 10⁻³ rad; under it the smallest error that any timestep gave.",
        &["Scene", "euler", "midpoint", "verlet", "rk4"],
    );
    for data in data {
        let mut row = vec![Cell::new(data.scene.title())];
        for method in Method::ALL {
            let least = data
                .of(method)
                .map(|run| run.outcome.error)
                .fold(f64::INFINITY, f64::min);
            let order = data
                .order(method)
                .map_or_else(|| "too few points".to_owned(), |o| format!("{o:.2}"));
            let least = if least > 0.0 {
                format!("down to {}", scientific(least))
            } else {
                "down to 0, bit for bit".to_owned()
            };
            row.push(Cell::new(order).detail(least));
        }
        table.rows.push(row);
    }
    table
}

/// Scenes whose speed is listed: one of each kind.
const SHOWN: [&str; 3] = ["swing-2", "swing-3", "reach-held"];

fn real_time(data: &[Data]) -> Table {
    let mut table = Table::new(
        "real-time",
        "Faster than the clock",
        "Time of one step, the least of all runs of a thousand steps and more; simulated over computing time at three timesteps; and what share of a 1 kHz loop \
         (1 ms per cycle, one step each) the step itself takes. Stepping only: no messages.",
        &[
            "Scene",
            "Method",
            "One step",
            "dt 1 ms",
            "dt 100 µs",
            "dt 10 µs",
            "Share of a 1 kHz loop",
        ],
    );
    for data in data
        .iter()
        .filter(|data| SHOWN.contains(&data.scene.name()))
    {
        for method in Method::ALL {
            let Some(step) = data.step_time(method) else {
                continue;
            };
            let factor = |timestep: f64| format!("{}×", number(timestep / step));
            table.rows.push(vec![
                Cell::new(data.scene.title()),
                Cell::method(method),
                Cell::new(seconds(step)),
                Cell::new(factor(1e-3)),
                Cell::new(factor(1e-4)),
                Cell::new(factor(1e-5)),
                Cell::new(format!("{} %", number(100.0 * step / 1e-3))),
            ]);
        }
    }
    table
}

fn scene_list(data: &[Data]) -> Table {
    let mut table = Table::new(
        "scenes",
        "The scenes",
        "Uncertainty: how far the reference itself may be off.",
        &["Scene", "Parameters", "Uncertainty"],
    );
    for data in data {
        table.rows.push(vec![
            Cell::new(data.scene.title()),
            Cell::new(data.scene.about()),
            Cell::new(scientific(data.scene.uncertainty())),
        ]);
    }
    table
}

fn findings(data: &[Data]) -> Vec<String> {
    let mut findings = Vec::new();
    let of = |name: &str| data.iter().find(|data| data.scene.name() == name);
    if let Some(swing) = of("swing-2") {
        let costs = Method::ALL.map(|method| swing.reaching(method, 1e-4));
        if let [Some(euler), _, Some(verlet), Some(rk4)] = costs {
            findings.push(format!(
                "**For 10⁻⁴ rad on a free 2-link swing RK4 takes steps of {}**, and {} evaluations per simulated second; Verlet needs {} times \
                 as many and Euler {} times.",
                seconds(rk4.timestep),
                number((rk4.evaluations / swing.scene.duration()).round()),
                number(verlet.evaluations / rk4.evaluations),
                number(euler.evaluations / rk4.evaluations),
            ));
        }
    }
    if let Some(held) = of("reach-held") {
        let at = |method, steps: u64| {
            held.of(method)
                .find(|run| run.outcome.steps == steps)
                .map(|run| run.outcome)
        };
        // 2 s in 2048 steps: the power of two next to the default timestep.
        if let (Some(rk4), Some(verlet)) = (at(Method::Rk4, 2048), at(Method::Verlet, 2048)) {
            findings.push(format!(
                "**With the effort held for each step, as the live arm does, RK4 is no better than Verlet**: at dt = {} they are {} and {} rad from the \
                 continuous law. What counts is the control period.",
                seconds(rk4.timestep),
                scientific(rk4.error),
                scientific(verlet.error)
            ));
        }
    }
    let fastest = of("swing-2").and_then(|data| data.step_time(Method::Rk4));
    let slowest = of("swing-3").and_then(|data| data.step_time(Method::Rk4));
    if let (Some(two), Some(three)) = (fastest, slowest) {
        findings.push(format!(
            "**One RK4 step takes {} with 2 links and {} with 3**: at the default 1 ms the arm runs {} and {} times faster than the clock.",
            seconds(two),
            seconds(three),
            number(1e-3 / two),
            number(1e-3 / three),
        ));
    }
    findings
}

fn verdicts(data: &[Data]) -> Vec<Verdict> {
    let mut worst: (f64, String) = (0.0, "no slope fitted".to_owned());
    for data in data {
        for method in Method::ALL {
            let expected = if data.scene.control() == "held" {
                1.0
            } else {
                f64::from(method.order())
            };
            if let Some(order) = data.order(method) {
                let off = (order - expected).abs();
                if off >= worst.0 {
                    worst = (
                        off,
                        format!(
                            "furthest off: {} in {}, {order:.2} for {expected:.0}",
                            method,
                            data.scene.title()
                        ),
                    );
                }
            }
        }
    }
    let smallest = data
        .iter()
        .flat_map(|data| &data.runs)
        .map(|run| run.outcome.error)
        .filter(|error| *error > 0.0)
        .fold(f64::INFINITY, f64::min);
    let uncertainty = data
        .iter()
        .map(|data| data.scene.uncertainty())
        .fold(0.0, f64::max);
    vec![
        Verdict {
            claim: "Every method converges at its order, and at order 1 where the effort is held (slopes within 0.35)".to_owned(),
            seen: worst.1,
            holds: worst.0 <= 0.35,
        },
        Verdict {
            claim: "References are at least 100 times better known than the smallest error shown".to_owned(),
            seen: format!("uncertainty at most {}, smallest error {}", scientific(uncertainty), scientific(smallest)),
            holds: uncertainty * 100.0 <= smallest,
        },
    ]
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of a run are far below 2^53"
)]
fn in_f64(count: u64) -> f64 {
    count as f64
}
