//! Slopes of lines through points: orders of convergence.
//!
//! **Invariant:** points are positive; a logarithm of anything else would show as no number.

use crate::math::count::length_in_f64;

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
