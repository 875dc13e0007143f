//! The largest stable control period, however many steps it is cut into.
//!
//! **Invariant:** what takes too long to measure is called not measured.

use super::super::super::Desk;
use super::super::super::section::{Cell, Table};
use super::super::super::svg::seconds;
use super::{Meter, setting};
use crate::math::integrator::Method;
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, largest_period};

/// Steps per control period.
const SUBSTEPS: [u32; 3] = [1, 10, 100];

/// Method, steps per control period, largest stable control period as predicted and as measured.
pub(super) type Period = (Method, u32, Option<f64>, Option<f64>);

pub(super) fn periods(desk: &mut Desk<'_>, meter: &mut Meter) -> Vec<Period> {
    let shipped = setting(1.0, Method::Rk4, Sampling::Held);
    let linear = Linear::at_setpoint(&shipped.arm, &shipped.gains, &shipped.setpoint);
    let mut periods = Vec::new();
    for method in Method::ALL {
        for substeps in SUBSTEPS {
            let predicted = largest_period(&linear, method, substeps);
            let setting = setting(1.0, method, Sampling::Held);
            // A hundred steps per period take seconds to measure.
            let measured = predicted
                .filter(|_| substeps <= desk.choose(100, 10))
                .and_then(|guess| setting.measured_period(guess, substeps, false));
            periods.push((method, substeps, predicted, measured));
            meter.add(desk, 3);
        }
    }
    periods
}

pub(super) fn period_table(periods: &[Period]) -> Table {
    let mut table = Table::new(
        "control-period",
        "The limit belongs to the control period",
        "Largest stable control period, predicted and measured, when the period is cut into 1, 10 or 100 steps of the method (2 links, shipped gains). Smaller steps at the \
         same control period buy nothing; Euler only moves to the limit of the others.",
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
