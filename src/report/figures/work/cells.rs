//! Cells that the rows of the step and of the server share.
//!
//! **Invariant:** what was not counted for this report is called not measured.

use crate::report::section::Cell;
use crate::report::svg::number;

pub(super) const UNMEASURED: &str = "not measured in this run";

/// The cell of a count that is missing.
pub(super) fn unmeasured() -> Cell {
    Cell::new(UNMEASURED).class("soft")
}

/// The share that is saved, of two counts.
pub(super) fn percent_saved(with: Option<f64>, without: Option<f64>) -> Cell {
    match (with, without) {
        (Some(with), Some(without)) => Cell::new(format!(
            "{} %",
            number((100.0 * (1.0 - without / with)).round())
        )),
        _ => Cell::default(),
    }
}
