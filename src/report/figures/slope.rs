//! Slopes of lines through points, and whether they are the orders of convergence that were expected.
//!
//! **Invariant:** points are positive; a logarithm of anything else would show as no number.

use crate::math::count::length_in_f64;
use crate::report::section::Cell;

/// By how much an order may be off.
pub(super) const AGREEMENT: f64 = 0.25;

/// Slope of the least-squares line through `(log x, log y)`; `None` for fewer than two points.
pub(super) fn slope(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    if logs.len() < 2 {
        return None;
    }
    let count = length_in_f64(logs.len());
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let along: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    Some(along / spread)
}

/// Whether an order, if one is to be seen, is the expected one.
pub(super) fn as_expected(order: Option<f64>, expected: u32) -> Option<bool> {
    Some((order? - f64::from(expected)).abs() <= AGREEMENT)
}

/// An order in a table, beside the expected one.
pub(super) fn order_cell(order: Option<f64>, expected: u32) -> Cell {
    match (order, as_expected(order, expected)) {
        (Some(order), Some(good)) => Cell::new(format!("{order:.2}"))
            .detail(format!("expected {expected}"))
            .class(if good { "good" } else { "bad" }),
        _ => Cell::new("not seen").class("bad"),
    }
}
