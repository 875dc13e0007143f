//! The largest stable timestep: predicted, measured, mapped over gains, and what it hangs on.
//!
//! **Invariant:** prediction and measurement share the arm and the gains, and nothing else.

mod map;
mod period;
mod radius;
mod regions;
mod words;

use map::map;
use period::{growth, period_table, periods};
use radius::radius_figure;
use regions::regions_figure;
use words::{findings, verdicts};

use crate::math::arm::Arm;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::report::experiments::measure::measured_limit;
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Section, Table};
use crate::report::svg::seconds;
use crate::study::control_loop::ControlLoop;
use crate::study::stability::{Sampling, limits};

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

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let cells = making.choose(48, 16);
    // Lines of the table count 3 each beside the rows of the maps.
    let mut meter = Meter {
        done: 0,
        of: 3 * 56 + 3 * 12 + 3 * 4 + 8 * cells,
    };
    let mut lines = Vec::new();
    for (name, gains) in gains_two() {
        lines_of(
            making,
            &mut meter,
            &mut lines,
            name,
            &ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8])),
        );
    }
    for (name, gains) in gains_three() {
        lines_of(
            making,
            &mut meter,
            &mut lines,
            name,
            &ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8, -0.5])),
        );
    }
    let map = map(making, &mut meter, cells);
    making.keep("stability-map", map.csv.clone());
    let periods = periods(making, &mut meter);
    let (radius, csv) = radius_figure(&lines);
    making.keep("spectral-radius", csv);
    let (regions, csv) = regions_figure(&stiffened(1.0));
    making.keep("regions", csv);
    let growth = growth(making, &mut meter);
    making.keep("control-period", growth.csv.clone());
    Section {
        findings: findings(&lines),
        verdicts: verdicts(&lines, &map, &periods, &growth),
        glance: vec![Block::Table(edges(&lines)), Block::Figure(regions)],
        blocks: vec![
            Block::Figure(radius),
            Block::Figure(growth.figure()),
            Block::Figure(map.figure()),
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
    fn add(&mut self, making: &mut Making<'_>, work: usize) {
        self.done += work;
        making.at(self.done, self.of);
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
    making: &mut Making<'_>,
    meter: &mut Meter,
    lines: &mut Vec<Line>,
    name: &'static str,
    control: &ControlLoop<N>,
) {
    for method in Method::ALL {
        let control = control.with_method(method);
        let limits = limits(&control);
        for sampling in Sampling::ALL {
            let (predicted, over_poses) = match sampling {
                Sampling::Held => (limits.held, limits.minimum_held),
                Sampling::Continuous => (limits.continuous, limits.minimum_continuous),
            };
            meter.add(making, 3);
            let Some(predicted) = predicted.filter(|limit| *limit > 0.0) else {
                continue;
            };
            lines.push(Line {
                links: N,
                gains: name,
                method,
                sampling,
                predicted,
                measured: measured_limit(&control, sampling, predicted),
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
        "Predicted from the loop linearised where it rests, at (0.4, 0.8), with 3 links (0.4, 0.8, -0.5), measured by nudging the arm itself and watching whether \
         it settles; the smallest limit of all poses, proven where it can be, and 0.8 times that as advice. Prediction and measurement must agree to 1 %.",
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

/// The 2-link arm with the shipped gains stiffened by `factor`: kp by it, kd by its root, ki by its power of 3/2.
fn stiffened(factor: f64) -> ControlLoop<2> {
    let Gains { kp, ki, kd } = Gains::<2>::default();
    let gains = Gains {
        kp: kp.map(|kp| kp * factor),
        ki: ki.map(|ki| ki * factor.powf(1.5)),
        kd: kd.map(|kd| kd * factor.sqrt()),
    };
    ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8]))
}

fn shipped(lines: &[Line], sampling: Sampling, method: Method) -> Option<&Line> {
    lines.iter().find(|line| {
        line.links == 2
            && line.gains == "shipped"
            && line.sampling == sampling
            && line.method == method
    })
}
