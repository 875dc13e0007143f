//! Slopes of fitted lines, and cells of a map.
//!
//! **Invariant:** there is one more edge than cells, and a cell is measured at its geometric centre.

use crate::math::count::length_in_f64;

/// Slope of the least-squares line through `(log x, log y)` of positive numbers; `None` for fewer than two.
pub(super) fn slope(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = length_in_f64(logs.len());
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let along: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    (logs.len() > 1).then(|| along / spread)
}

/// The edges of `count` cells from `low` to `high`, each as many times as large as the one before.
pub(super) fn edges((low, high): (f64, f64), count: usize) -> Vec<f64> {
    let part = |index: usize| length_in_f64(index) / length_in_f64(count);
    let edges = (0..=count).map(|index| low * (high / low).powf(part(index)));
    edges.collect()
}

/// The geometric middle of each cell.
pub(super) fn centres(edges: &[f64]) -> Vec<f64> {
    let pairs = edges.windows(2);
    pairs
        .map(|pair| pair.iter().product::<f64>().sqrt())
        .collect()
}
