//! Energy over very many steps, and the law by which rounding adds up.
//!
//! **Invariant:** a law is fitted to what was run, never extended beyond it.

use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::rounding::{Adding, energy_error, law};
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Figure, Section, Table, Verdict};
use crate::report::svg::{Axis, Curve, Key, Plot, Unit, power, scientific, seconds};

/// Timestep \[s\]: so short that truncation of Runge-Kutta 4 is out of sight for 1e8 steps.
const TIMESTEP: f64 = 2e-5;

const BOTH: [(Adding, &str); 2] = [(Adding::Compensated, "carried"), (Adding::Plain, "plain")];

struct EnergyRun {
    method: Method,
    adding: Adding,
    sums: &'static str,
    points: Vec<(f64, f64)>,
}

impl EnergyRun {
    fn end(&self) -> (f64, f64) {
        self.points.last().copied().unwrap_or((0.0, f64::NAN))
    }
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    // Only with the smallest truncation error is there anything to be seen after so many steps.
    let steps = |method: Method, quick: bool| match (method, quick) {
        (Method::Rk4, false) => 100_000_000,
        (Method::Rk4, true) | (_, false) => 10_000_000,
        (_, true) => 1_000_000,
    };
    let mut runs = Vec::new();
    for method in Method::ALL {
        for (adding, sums) in BOTH {
            let steps = steps(method, making.quick);
            let points = energy_error(method, TIMESTEP, steps, adding);
            runs.push(EnergyRun {
                method,
                adding,
                sums,
                points,
            });
            making.at(runs.len(), 8);
        }
    }
    section(making, &runs)
}

fn section(making: &mut Making<'_>, runs: &[EnergyRun]) -> Section {
    let mut csv = Csv::new("method,sums,dt,steps,dE_max_scaled");
    for run in runs {
        for (steps, error) in &run.points {
            csv.row(&[
                run.method.name().into(),
                run.sums.into(),
                TIMESTEP.into(),
                (*steps).into(),
                (*error).into(),
            ]);
        }
    }
    making.keep("rounding", csv);
    Section {
        findings: finding(runs).into_iter().collect(),
        verdicts: verdict(runs).into_iter().collect(),
        blocks: vec![Block::Figure(figure(runs)), Block::Table(table(runs))],
        ..Section::default()
    }
}

fn of(runs: &[EnergyRun], method: Method, adding: Adding) -> Option<&EnergyRun> {
    runs.iter()
        .find(|run| run.method == method && run.adding == adding)
}

fn finding(runs: &[EnergyRun]) -> Option<String> {
    let carried = of(runs, Method::Rk4, Adding::Compensated)?.end();
    let plain = of(runs, Method::Rk4, Adding::Plain)?;
    Some(format!(
        "**After {} steps of RK4 at {} the energy of a regular 2-link swing is off by {} of its scale; without \
         carrying the rounding of sums by {}**, which grew with {} of the number of steps in the last three decades.",
        power(carried.0.log10().round()),
        seconds(TIMESTEP),
        scientific(carried.1),
        scientific(plain.end().1),
        law(&plain.points)
            .map_or_else(|| "?".to_owned(), |law| format!("powers of {}", range(law)))
    ))
}

/// From the least to the largest, in tenths.
fn range((least, most): (f64, f64)) -> String {
    format!("{least:.1} to {most:.1}")
}

fn verdict(runs: &[EnergyRun]) -> Option<Verdict> {
    let carried = of(runs, Method::Rk4, Adding::Compensated)?.end().1;
    let plain = of(runs, Method::Rk4, Adding::Plain)?.end().1;
    Some(Verdict {
        claim: "Carrying the rounding of sums leaves RK4 at most a tenth of the energy error of plain sums".to_owned(),
        seen: format!("{} against {}", scientific(carried), scientific(plain)),
        holds: carried <= 0.1 * plain,
    })
}

fn figure(runs: &[EnergyRun]) -> Figure {
    let plots: Vec<Plot> = BOTH
        .iter()
        .map(|(adding, _)| {
            let title = match adding {
                Adding::Compensated => "Rounding of sums carried, as the live arm does",
                Adding::Plain => "Plain sums",
            };
            let mut plot = Plot::new(
                title,
                Axis::log_between("steps", Unit::Number, 1e2, 1e8),
                Axis::log_between(
                    "largest energy error so far / scale",
                    Unit::Number,
                    1e-16,
                    1.0,
                ),
            );
            for run in runs.iter().filter(|run| run.adding == *adding) {
                let points = run.points.iter().filter(|point| point.1 > 0.0).copied();
                plot.series.push(Curve::line(run.method.name(), points));
            }
            // Two laws to hold the lines against.
            for (power, from) in [(0.5, 1e-15), (1.0, 1e-15)] {
                let ends = [1e2, 1e8].map(|steps: f64| (steps, from * (steps / 1e2).powf(power)));
                plot.series.push(Curve {
                    dashed: true,
                    ..Curve::line("soft", ends)
                });
            }
            plot
        })
        .collect();
    let mut keys: Vec<Key> = Method::ALL
        .iter()
        .map(|method| Key::line(method.name(), method.name()))
        .collect();
    keys.push(Key {
        dashed: true,
        ..Key::line(
            "soft",
            "growth with the root of the steps, and in proportion to them",
        )
    });
    Figure::new(
        "rounding",
        "Energy over very many steps",
        format!(
            "A regular swing of 2 links, let go 0.3 rad off the hanging pose, no control, steps of {}. The energy \
             itself is computed in doubles, and that alone is \
             off by some 10⁻¹⁵ of the scale.",
            seconds(TIMESTEP)
        ),
        &keys,
        &plots,
    )
}

fn table(runs: &[EnergyRun]) -> Table {
    let mut table = Table::new(
        "rounding",
        "Laws of growth",
        "The exponent is fitted over each of the last three decades of steps; given are the least and the largest: 0 \
         where nothing grows or the error is bounded, 1/2 of a random walk, 1 in proportion to the steps.",
        &[
            "Method",
            "Sums",
            "Steps",
            "Energy error / scale",
            "Exponent",
        ],
    );
    for run in runs {
        let (steps, error) = run.end();
        table.rows.push(vec![
            Cell::method(run.method),
            Cell::new(run.sums),
            Cell::new(power(steps.log10().round())),
            Cell::new(scientific(error)),
            Cell::new(law(&run.points).map_or_else(|| "–".to_owned(), range)),
        ]);
    }
    table
}
