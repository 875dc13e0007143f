//! The largest stable control period and the growth per period, however many steps it is cut into.
//!
//! **Invariant:** what takes too long to measure is called not measured.

use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::growth::growth_per_period;
use crate::report::experiments::measure::{measured_period, stiffened};
use crate::report::making::Making;
use crate::report::section::{Cell, Figure, Table};
use crate::report::svg::{Axis, Curve, Key, Mark, Marker, Plot, Point, Unit, number, seconds};
use crate::study::linear::Linear;
use crate::study::stability::{largest_period, period_matrix};

/// Ends of the axis of control periods \[s\], and the growth up to which curves are drawn.
const PERIODS: (f64, f64) = (5e-4, 2e-2);
const GROWTH: (f64, f64) = (0.85, 1.15);

/// Steps per control period.
const SUBSTEPS: [u32; 3] = [1, 10, 100];

/// Method, steps per control period, largest stable control period as predicted and as measured.
pub(super) type Period = (Method, u32, Option<f64>, Option<f64>);

pub(super) fn periods(making: &Making<'_>) -> Vec<Period> {
    let linear = Linear::at_setpoint(&stiffened(1.0));
    let mut periods = Vec::new();
    for method in Method::ALL {
        for substeps in SUBSTEPS {
            let predicted = largest_period(&linear, method, substeps);
            let control = stiffened(1.0).with_method(method);
            // A hundred steps per period take seconds to measure.
            let measured = predicted
                .filter(|_| substeps <= making.choose(100, 10))
                .and_then(|guess| measured_period(&control, guess, substeps, false));
            periods.push((method, substeps, predicted, measured));
        }
    }
    periods
}

pub(super) fn period_table(periods: &[Period]) -> Table {
    let mut table = Table::new(
        "period-limits",
        "The limit belongs to the control period",
        "Largest stable control period, predicted and measured, when the period is cut into 1, 10 or 100 steps of the \
         method (2 links, default gains). Smaller steps at the same control period buy nothing; Euler only moves to \
         the limit of the others.",
        &["Method", "1 step per period", "10 steps", "100 steps"],
    );
    for method in Method::ALL {
        let mut row = vec![Cell::method(method)];
        for (_, _, predicted, measured) in periods.iter().filter(|period| period.0 == method) {
            let measured = measured.map_or_else(
                || "not measured".to_owned(),
                |limit| format!("measured {}", seconds(limit)),
            );
            row.push(
                Cell::new(predicted.map_or_else(|| "none".to_owned(), seconds)).detail(measured),
            );
        }
        table.rows.push(row);
    }
    table
}

/// Growth per control period, predicted and measured, and the figure of it.
pub(super) struct Growth {
    pub(super) csv: Csv,
    /// Dots, and how far the furthest lies from its curve, as a part of the growth.
    pub(super) dots: usize,
    pub(super) furthest: f64,
    /// How far the curves of 1, 10 and 100 steps are apart at most, for methods of order 2 and more.
    apart: f64,
    plots: Vec<Plot>,
}

/// Curves and dots for every method and number of steps per period.
pub(super) fn growth(making: &Making<'_>) -> Growth {
    let mut growth = Growth {
        csv: Csv::new("method,substeps,period,growth_predicted,growth_measured"),
        dots: 0,
        furthest: 0.0,
        apart: 0.0,
        plots: Vec::new(),
    };
    let dots = making.choose(12, 4);
    for method in Method::ALL {
        growth.panel(method, dots);
    }
    growth
}

/// Curve and dots of one number of steps per period.
const LOOKS: [(&str, Marker); 3] = [
    ("c2", Marker::Square),
    ("c3", Marker::Triangle),
    ("c1", Marker::Circle),
];

/// Control periods near the limit that are measured too, as parts of it.
const AROUND: [f64; 6] = [0.985, 0.995, 1.005, 1.015, 1.03, 1.045];

/// The one of three turns that the dots of so many steps per period take.
fn turn_of(substeps: u32) -> u32 {
    match substeps {
        1 => 0,
        10 => 1,
        _ => 2,
    }
}

fn between(index: u32, count: u32) -> f64 {
    PERIODS.0 * (PERIODS.1 / PERIODS.0).powf(f64::from(index) / f64::from(count))
}

impl Growth {
    fn panel(&mut self, method: Method, dots: u32) {
        let control = stiffened(1.0).with_method(method);
        let linear = Linear::at_setpoint(&control);
        let x = Axis::log_between("control period", Unit::Seconds, PERIODS.0, PERIODS.1);
        let y = Axis::linear("growth per control period", GROWTH.0, GROWTH.1);
        let mut plot = Plot::new(method.name(), x, y);
        plot.marks.push(Mark::Horizontal {
            y: 1.0,
            class: "ink",
            label: "unstable above".to_owned(),
            right: false,
        });
        for (substeps, (class, marker)) in SUBSTEPS.into_iter().zip(LOOKS) {
            let predicted =
                |period| period_matrix(&linear, method, substeps, period).spectral_radius();
            let curve = (0..=200)
                .map(|index| between(index, 200))
                .map(|period| (period, predicted(period)))
                .filter(|(_, growth)| *growth <= GROWTH.1);
            plot.series.push(Curve::line(class, curve));
            let mut points = Vec::new();
            // Along the curve in turns, so that one mark does not hide the next, and closely where it turns up.
            let turn = turn_of(substeps);
            let along = (0..dots).map(|index| between(3 * index + turn, 3 * dots));
            let limit = largest_period(&linear, method, substeps).unwrap_or(f64::NAN);
            let steep = AROUND.map(|part| limit * (part + 0.002 * f64::from(turn)));
            for period in along.chain(steep) {
                let expected = predicted(period);
                // NaN where there is no limit to look around.
                if expected.is_nan() || expected > GROWTH.1 {
                    continue;
                }
                let measured = growth_per_period(&control.with_timestep(period), substeps);
                self.csv.row(&[
                    method.name().into(),
                    u64::from(substeps).into(),
                    period.into(),
                    expected.into(),
                    measured.into(),
                ]);
                let measured = measured.unwrap_or(f64::INFINITY);
                if method != Method::Euler {
                    let whole = period_matrix(&linear, method, 1, period).spectral_radius();
                    self.apart = self.apart.max((expected / whole - 1.0).abs());
                }
                self.dots += 1;
                self.furthest = self.furthest.max((measured / expected - 1.0).abs());
                let tooltip = format!(
                    "{substeps} steps in {}: {measured:.5} measured, {expected:.5} predicted",
                    seconds(period)
                );
                points.push(Point::new(period, measured, tooltip));
            }
            plot.series.push(Curve {
                class,
                marker,
                line: false,
                dashed: false,
                points,
            });
        }
        self.plots.push(plot);
    }

    pub(super) fn figure(&self) -> Figure {
        let keys: Vec<Key> = SUBSTEPS
            .into_iter()
            .zip(LOOKS)
            .map(|(substeps, (class, marker))| Key {
                class,
                marker,
                dashed: false,
                label: match substeps {
                    1 => "1 step per period".to_owned(),
                    more => format!("{more} steps per period"),
                },
            })
            .collect();
        Figure::new(
            "control-period",
            format!(
                "1, 10 and 100 steps per control period give the same growth to {} % from order 2 on; {} measurements \
                 lie on their curves to {} %",
                number(100.0 * self.apart),
                self.dots,
                number(100.0 * self.furthest)
            ),
            "2 links, default gains, effort held over the period. Curves: spectral radius of one control period of the \
             linearised loop. Dots: how much a nudge of the arm itself grows per period, over 4000 periods. Only Euler \
             with one step per period has a curve of its own.",
            &keys,
            &self.plots,
        )
    }
}
