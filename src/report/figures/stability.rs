//! The largest stable timestep: predicted, measured, mapped over gains, and what it hangs on.
//!
//! **Invariant:** prediction and measurement share the arm and the gains, and nothing else.

use super::super::Desk;
use super::super::csv::Csv;
use super::super::section::{Block, Cell, Figure, Section, Table, Verdict};
use super::super::svg::{
    Axis, Heat, Key, Mark, Marker, Plot, Point, Series, Unit, number, seconds,
};
use crate::math::arm::Arm;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::study::linear::Linear;
use crate::study::measure::Setting;
use crate::study::stability::{Sampling, largest_period, largest_timestep, limits, step_matrix};

/// Measured and predicted limits may differ by this part.
const AGREEMENT: f64 = 0.01;

/// One line of the table of limits.
struct Line {
    links: usize,
    gains: &'static str,
    method: Method,
    sampling: Sampling,
    predicted: f64,
    measured: Option<f64>,
    over_poses: Option<f64>,
    advised: Option<f64>,
}

impl Line {
    fn ratio(&self) -> Option<f64> {
        Some(self.measured? / self.predicted)
    }
}

pub(super) fn make(desk: &mut Desk<'_>) -> Section {
    let cells = desk.choose(48, 16);
    // Lines of the table count 3 each beside the rows of the maps.
    let mut meter = Meter {
        done: 0,
        of: 3 * 56 + 8 * cells,
    };
    let mut lines = Vec::new();
    let bent = |position| Setpoint {
        position,
        velocity: [0.0; 2],
    };
    for (name, gains) in gains_two() {
        lines_of(
            desk,
            &mut meter,
            &mut lines,
            name,
            &Arm::<2>::default(),
            &gains,
            &bent([0.4, 0.8]),
        );
    }
    for (name, gains) in gains_three() {
        let setpoint = Setpoint {
            position: [0.4, 0.8, -0.5],
            velocity: [0.0; 3],
        };
        lines_of(
            desk,
            &mut meter,
            &mut lines,
            name,
            &Arm::<3>::default(),
            &gains,
            &setpoint,
        );
    }
    let map = map(desk, &mut meter, cells);
    desk.keep("stability-map", map.1);
    let periods = periods();
    let (radius, csv) = radius_figure(&lines);
    desk.keep("spectral-radius", csv);
    Section {
        findings: findings(&lines),
        verdicts: verdicts(&lines, map.2, &periods),
        glance: vec![edges(&lines)],
        blocks: vec![
            Block::Figure(radius),
            Block::Figure(map.0),
            Block::Table(table(&lines)),
            Block::Table(period_table(&periods)),
        ],
        ..Section::default()
    }
}

struct Meter {
    done: usize,
    of: usize,
}

impl Meter {
    fn add(&mut self, desk: &mut Desk<'_>, work: usize) {
        self.done += work;
        desk.at(self.done, self.of);
    }
}

fn gains<const N: usize>(kp: [f64; N], kd: [f64; N]) -> Gains<N> {
    Gains {
        kp,
        ki: [0.0; N],
        kd,
    }
}

fn gains_two() -> [(&'static str, Gains<2>); 4] {
    [
        ("mild", gains([200.0, 100.0], [30.0, 12.0])),
        ("shipped", Gains::<2>::default()),
        ("stiff", gains([1e4, 1e4], [200.0, 60.0])),
        ("overdamped", gains([200.0, 200.0], [500.0, 500.0])),
    ]
}

fn gains_three() -> [(&'static str, Gains<3>); 3] {
    [
        ("shipped", Gains::<3>::default()),
        ("stiff", gains([1e4; 3], [300.0, 100.0, 30.0])),
        ("overdamped", gains([200.0; 3], [500.0; 3])),
    ]
}

fn lines_of<const N: usize>(
    desk: &mut Desk<'_>,
    meter: &mut Meter,
    lines: &mut Vec<Line>,
    name: &'static str,
    arm: &Arm<N>,
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
) {
    for method in Method::ALL {
        let limits = limits(arm, gains, setpoint, method);
        for sampling in Sampling::ALL {
            let (predicted, over_poses) = match sampling {
                Sampling::Held => (limits.held, limits.minimum_held),
                Sampling::Continuous => (limits.continuous, limits.minimum_continuous),
            };
            meter.add(desk, 3);
            let Some(predicted) = predicted.filter(|limit| *limit > 0.0) else {
                continue;
            };
            let setting = Setting {
                arm: *arm,
                gains: *gains,
                setpoint: *setpoint,
                method,
                sampling,
            };
            lines.push(Line {
                links: N,
                gains: name,
                method,
                sampling,
                predicted,
                measured: setting.measured_limit(predicted),
                over_poses,
                advised: limits.advised.filter(|_| sampling == Sampling::Held),
            });
        }
    }
}

fn told(sampling: Sampling) -> &'static str {
    match sampling {
        Sampling::Held => "effort held for the step (as shipped)",
        Sampling::Continuous => "law in every stage",
    }
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn table(lines: &[Line]) -> Table {
    let mut table = Table::new(
        "limits",
        "Largest stable timesteps",
        "Predicted from the loop linearised at its setpoint, measured by nudging the arm itself and watching whether it settles; the smallest predicted limit over \
         a grid of poses, and 0.8 times that as advice. Prediction and measurement must agree to 1 %.",
        &[
            "Links",
            "Gains",
            "Method",
            "Control",
            "Predicted",
            "Measured",
            "Measured / predicted",
            "Over all poses",
            "Advised",
        ],
    );
    for line in lines {
        let time = |limit: Option<f64>| {
            limit.map_or_else(|| Cell::new("–"), |limit| Cell::new(seconds(limit)))
        };
        let ratio = line.ratio();
        let good = ratio.is_some_and(|ratio| (ratio - 1.0).abs() <= AGREEMENT);
        table.rows.push(vec![
            Cell::new(line.links.to_string()),
            Cell::new(line.gains),
            Cell::method(line.method),
            Cell::new(told(line.sampling)),
            Cell::new(seconds(line.predicted)),
            line.measured.map_or_else(
                || Cell::new("none found").class("bad"),
                |measured| Cell::new(seconds(measured)),
            ),
            ratio.map_or_else(Cell::default, |ratio| {
                Cell::new(format!("{ratio:.5}")).class(if good { "good" } else { "bad" })
            }),
            time(line.over_poses),
            time(line.advised),
        ]);
    }
    table
}

fn edges(lines: &[Line]) -> Table {
    let mut table = Table::new(
        "edges",
        "At a glance: where it goes unstable, and why",
        "Largest stable timestep with the shipped gains. Held for the step, the limit belongs to the control period: the effort answers a state that is \
         up to a step old. In every stage it belongs to the method.",
        &[
            "Arm", "Control", "euler", "midpoint", "verlet", "rk4", "Why",
        ],
    );
    for links in [2, 3] {
        for sampling in Sampling::ALL {
            let of = |method| {
                lines.iter().find(|line| {
                    line.links == links
                        && line.gains == "shipped"
                        && line.sampling == sampling
                        && line.method == method
                })
            };
            let mut row = vec![
                Cell::new(format!("{links} links, shipped gains")),
                Cell::new(told(sampling)),
            ];
            for method in Method::ALL {
                row.push(match of(method) {
                    Some(line) => {
                        let measured = line.measured.map_or_else(
                            || "not measured".to_owned(),
                            |m| format!("measured {}", seconds(m)),
                        );
                        Cell::new(seconds(line.predicted)).detail(measured)
                    }
                    None => Cell::new("none").class("bad"),
                });
            }
            row.push(Cell::new(match sampling {
                Sampling::Held => "the control period: damping answers too late",
                Sampling::Continuous => "the method's stability region",
            }));
            table.rows.push(row);
        }
    }
    table
}

/// Spectral radius of the step matrix against the timestep, with measured limits.
fn radius_figure(lines: &[Line]) -> (Figure, Csv) {
    let arm = Arm::<2>::default();
    let setpoint = Setpoint {
        position: [0.4, 0.8],
        velocity: [0.0; 2],
    };
    let mut csv = Csv::new("control,method,dt,spectral_radius");
    let linear = Linear::at_setpoint(&arm, &Gains::<2>::default(), &setpoint);
    let plots = Sampling::ALL.map(|sampling| {
        let x = Axis::log_between("timestep", Unit::Seconds, 5e-4, 2e-2);
        let y = Axis::linear("growth per step (spectral radius)", 0.9, 1.1);
        let mut plot = Plot::new(capital(told(sampling)), x, y);
        plot.marks.push(Mark::Horizontal {
            y: 1.0,
            class: "ink",
            label: "unstable above".to_owned(),
        });
        for method in Method::ALL {
            let curve = (0..=400).map(|index| {
                let h = 5e-4 * 40_f64.powf(f64::from(index) / 400.0);
                (
                    h,
                    step_matrix(&linear, method, sampling, h).spectral_radius(),
                )
            });
            let curve: Vec<(f64, f64)> = curve.collect();
            for (h, radius) in &curve {
                csv.row(&[
                    sampling.name().into(),
                    method.name().into(),
                    (*h).into(),
                    (*radius).into(),
                ]);
            }
            let shown = curve.into_iter().filter(|(_, radius)| *radius <= 1.1);
            plot.series.push(Series {
                // Where curves lie on each other the dashed one lets the other through.
                dashed: matches!(method, Method::Verlet | Method::Rk4)
                    && sampling == Sampling::Held,
                ..Series::line(method.name(), shown)
            });
            let measured = lines
                .iter()
                .find(|line| {
                    line.links == 2
                        && line.gains == "shipped"
                        && line.sampling == sampling
                        && line.method == method
                })
                .and_then(|line| line.measured);
            if let Some(limit) = measured {
                plot.series.push(Series {
                    class: method.name(),
                    marker: Marker::of(method),
                    line: false,
                    dashed: false,
                    points: vec![Point::new(
                        limit,
                        1.0,
                        format!("{method}: measured limit {}", seconds(limit)),
                    )],
                });
            }
        }
        plot
    });
    let figure = Figure::new(
        "spectral-radius",
        "With the effort held, midpoint, Verlet and RK4 go unstable at the same timestep; only a law in every stage shows the method",
        "2 links, shipped gains. Lines are predicted: the largest eigenvalue of one step of the linearised loop. Marks are where the arm itself was measured to stop settling.",
        &Key::methods(),
        &plots,
    );
    (figure, csv)
}

/// The map, its numbers, and how many cells were judged and how many of them disagree.
fn map(desk: &mut Desk<'_>, meter: &mut Meter, cells: usize) -> (Figure, Csv, (usize, usize)) {
    let mut csv = Csv::new("control,method,dt,gain_factor,growth,predicted_limit");
    let mut plots = Vec::new();
    let mut tally = (0, 0);
    let x_edges = edges_between(2e-4, 1e-1, cells);
    let y_edges = edges_between(1e-2, 1e2, cells * 3 / 4);
    for sampling in Sampling::ALL {
        for method in Method::ALL {
            let mut plot = Plot::new(
                format!("{method}, {}", sampling.name()),
                Axis::log_between("timestep", Unit::Seconds, 2e-4, 1e-1),
                Axis::log_between(
                    "stiffness, times the shipped gains",
                    Unit::Number,
                    1e-2,
                    1e2,
                ),
            );
            let mut rows = Vec::new();
            let mut line = Vec::new();
            let mut disagree = Vec::new();
            for factor in centres(&y_edges) {
                let setting = setting(factor, method, sampling);
                let linear = Linear::at_setpoint(&setting.arm, &setting.gains, &setting.setpoint);
                let limit = largest_timestep(&linear, method, sampling).unwrap_or(f64::INFINITY);
                line.push((limit, factor));
                let mut row = Vec::new();
                for h in centres(&x_edges) {
                    let growth = setting.growth(h);
                    row.push(level(growth));
                    tally.0 += 1;
                    if growth.is_some_and(|growth| growth < 1.0) != (h < limit) {
                        tally.1 += 1;
                        disagree.push(Point::new(
                            h,
                            factor,
                            format!("predicted limit {}", seconds(limit)),
                        ));
                    }
                    csv.row(&[
                        sampling.name().into(),
                        method.name().into(),
                        h.into(),
                        factor.into(),
                        growth.into(),
                        limit.into(),
                    ]);
                }
                rows.push(row);
                meter.add(desk, 1);
            }
            plot.heat = Some(Heat {
                x: x_edges.clone(),
                y: y_edges.clone(),
                rows,
            });
            plot.series.push(Series::line("ink", line));
            plot.series.push(Series {
                class: "ink",
                marker: Marker::Circle,
                line: false,
                dashed: false,
                points: disagree,
            });
            plots.push(plot);
        }
    }
    let figure = Figure::new(
        "stability-map",
        format!(
            "Predicted and measured stability agree in {} of {} cells",
            tally.0 - tally.1,
            tally.0
        ),
        "2 links at their setpoint, shipped gains stiffened by a factor (kp by it, kd by its root, ki by its power of 3/2: the same motion, faster). Colour: whether \
         a nudge of the arm itself dies out (blue) or grows (orange), the darker the faster. Line: the predicted limit. Dots: cells where the two disagree. In the lowest rows the gains are too weak \
         to carry the arm against gravity: no timestep is stable.",
        &[Key::line("ink", "predicted limit")],
        &plots,
    );
    (figure, csv, tally)
}

fn setting(factor: f64, method: Method, sampling: Sampling) -> Setting<2> {
    let Gains { kp, ki, kd } = Gains::<2>::default();
    Setting {
        arm: Arm::default(),
        gains: Gains {
            kp: kp.map(|kp| kp * factor),
            ki: ki.map(|ki| ki * factor.powf(1.5)),
            kd: kd.map(|kd| kd * factor.sqrt()),
        },
        setpoint: Setpoint {
            position: [0.4, 0.8],
            velocity: [0.0; 2],
        },
        method,
        sampling,
    }
}

/// Colour of a growth of energy over a few thousand steps.
fn level(growth: Option<f64>) -> i8 {
    match growth {
        None => 4,
        Some(growth) if growth > 1e4 => 3,
        Some(growth) if growth > 10.0 => 2,
        Some(growth) if growth >= 1.0 => 1,
        Some(growth) if growth > 0.1 => -1,
        Some(growth) if growth > 1e-4 => -2,
        Some(growth) if growth > 0.0 => -3,
        Some(_) => -4,
    }
}

fn edges_between(low: f64, high: f64, count: usize) -> Vec<f64> {
    #[allow(
        clippy::cast_precision_loss,
        reason = "counts of cells are far below 2^53"
    )]
    let part = |index: usize| index as f64 / count as f64;
    (0..=count)
        .map(|index| low * (high / low).powf(part(index)))
        .collect()
}

fn centres(edges: &[f64]) -> impl Iterator<Item = f64> + '_ {
    edges
        .windows(2)
        .map(|pair| pair.iter().product::<f64>().sqrt())
}

/// Method, substeps per control period, largest stable control period.
type Period = (Method, u32, Option<f64>);

fn periods() -> Vec<Period> {
    let setpoint = Setpoint {
        position: [0.4, 0.8],
        velocity: [0.0; 2],
    };
    let linear = Linear::at_setpoint(&Arm::<2>::default(), &Gains::<2>::default(), &setpoint);
    let mut periods = Vec::new();
    for method in Method::ALL {
        for substeps in [1, 10, 100] {
            periods.push((method, substeps, largest_period(&linear, method, substeps)));
        }
    }
    periods
}

fn period_table(periods: &[Period]) -> Table {
    let mut table = Table::new(
        "control-period",
        "The limit belongs to the control period",
        "Largest stable control period, predicted, when the period is cut into 1, 10 or 100 steps of the method (2 links, shipped gains). Smaller steps at the \
         same control period buy nothing but for Euler.",
        &["Method", "1 step per period", "10 steps", "100 steps"],
    );
    for method in Method::ALL {
        let mut row = vec![Cell::method(method)];
        for (_, _, period) in periods.iter().filter(|period| period.0 == method) {
            row.push(Cell::new(period.map_or_else(|| "–".to_owned(), seconds)));
        }
        table.rows.push(row);
    }
    table
}

fn shipped(lines: &[Line], sampling: Sampling, method: Method) -> Option<&Line> {
    lines.iter().find(|line| {
        line.links == 2
            && line.gains == "shipped"
            && line.sampling == sampling
            && line.method == method
    })
}

fn findings(lines: &[Line]) -> Vec<String> {
    let mut findings = Vec::new();
    let at = |sampling, method| shipped(lines, sampling, method).map(|line| line.predicted);
    if let (Some(verlet), Some(rk4), Some(continuous)) = (
        at(Sampling::Held, Method::Verlet),
        at(Sampling::Held, Method::Rk4),
        at(Sampling::Continuous, Method::Rk4),
    ) {
        findings.push(format!(
            "**With the shipped gains the live 2-link arm goes unstable at {} with RK4 and at {} with Verlet**: the same, since the effort is held for the step. With the law in \
             every stage RK4 would be stable up to {}.",
            seconds(rk4),
            seconds(verlet),
            seconds(continuous)
        ));
    }
    let worst = worst(lines);
    findings.push(format!(
        "**The linearised loop predicts the arm's own limit to {} %** in {} cases: 2 and 3 links, mild to overdamped gains, all methods, both kinds of control.",
        number(100.0 * worst),
        lines.len()
    ));
    findings
}

fn worst(lines: &[Line]) -> f64 {
    lines
        .iter()
        .map(|line| {
            line.ratio()
                .map_or(f64::INFINITY, |ratio| (ratio - 1.0).abs())
        })
        .fold(0.0, f64::max)
}

fn verdicts(lines: &[Line], map: (usize, usize), periods: &[Period]) -> Vec<Verdict> {
    let worst = worst(lines);
    let spread = {
        let limits = periods
            .iter()
            .filter(|period| period.0 != Method::Euler)
            .filter_map(|period| period.2);
        let (low, high) = limits.fold((f64::INFINITY, 0.0_f64), |(low, high), limit| {
            (low.min(limit), high.max(limit))
        });
        high / low - 1.0
    };
    vec![
        Verdict {
            claim: format!("Predicted and measured limits agree to 1 % in all {} cases", lines.len()),
            seen: format!("furthest apart {} %", number(100.0 * worst)),
            holds: worst <= AGREEMENT,
        },
        Verdict {
            claim: "At most 1 % of the map's cells disagree with the prediction".to_owned(),
            seen: format!("{} of {}", map.1, map.0),
            holds: map.1 * 100 <= map.0,
        },
        Verdict {
            claim: "With a held effort midpoint, Verlet and RK4 share one limit of the control period, however many steps it is cut into (within 0.1 %)".to_owned(),
            seen: format!("{} % between the smallest and the largest", number(100.0 * spread)),
            holds: spread <= 1e-3,
        },
    ]
}
