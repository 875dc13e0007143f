//! The tables: cheapest methods, orders, scenes, and every run in numbers.
//!
//! **Invariant:** what no run reached is called not reached.

use super::data::{Data, Run, TARGETS, best};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::{Csv, CsvField};
use crate::report::section::{Cell, Table, by_method};
use crate::report::svg::{number, power, scientific, seconds};

pub(super) fn cheapest(data: &[Data]) -> Table {
    let mut head = vec!["Scene".to_owned()];
    head.extend(TARGETS.map(|target| format!("{} rad", power(target.log10().round()))));
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "cheapest",
        "At a glance: the cheapest method for each error",
        "Fewest evaluations; under it the timestep, and evaluations and computing time for one simulated second; last \
         how many times more evaluations the next best method needs. Every cell is a run: that of the fewest \
         steps that were found to keep the error. The particle's errors are in m.",
        &head,
    );
    for data in data {
        let mut row = vec![Cell::new(data.scene.title())];
        for target in TARGETS {
            row.push(match best(data, target) {
                None => Cell::new("not reached").class("soft"),
                Some((run, next)) => {
                    let evaluations = |run: &Run| in_f64(run.outcome.evaluations);
                    let per_second = evaluations(run) / data.scene.duration();
                    let time = seconds(run.timing.minimum / data.scene.duration());
                    let next = next.map_or_else(String::new, |next| {
                        let more = evaluations(next) / evaluations(run);
                        format!("; {} ×{}", next.method, number(more))
                    });
                    Cell::method(run.method).detail(format!(
                        "dt {}; {} evaluations, {time} per s{next}",
                        seconds(run.outcome.timestep),
                        number(per_second.round())
                    ))
                }
            });
        }
        table.rows.push(row);
    }
    table
}

pub(super) fn orders(data: &[Data]) -> Table {
    let mut table = Table::new(
        "orders",
        "Fitted orders",
        "Slope of error against timestep through the four finest runs between 10⁻¹¹ and 10⁻³ rad; under it the \
         smallest error that any timestep gave.",
        &by_method(&["Scene"], &[]),
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

pub(super) fn scene_list(data: &[Data]) -> Table {
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

/// Every run in numbers, for the file beside the page.
pub(super) fn table_of_runs(data: &[Data]) -> Csv {
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
                "live".into(),
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
                outcome.end_effector_error.into(),
                outcome.energy_drift.into(),
                CsvField::Text(if outcome.diverged.is_some() {
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
