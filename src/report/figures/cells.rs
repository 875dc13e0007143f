//! Cells of a map: their edges along a logarithmic axis, and where they are measured.
//!
//! **Invariant:** there is one more edge than cells, and a cell is measured between two of them.

use crate::math::count::length_in_f64;

/// The edges of `count` cells from `low` to `high`, each as many times as large as the one before.
pub(super) fn edges((low, high): (f64, f64), count: usize) -> Vec<f64> {
    let part = |index: usize| length_in_f64(index) / length_in_f64(count);
    (0..=count)
        .map(|index| low * (high / low).powf(part(index)))
        .collect()
}

/// The geometric middle of each cell.
pub(super) fn centres(edges: &[f64]) -> Vec<f64> {
    edges
        .windows(2)
        .map(|pair| pair.iter().product::<f64>().sqrt())
        .collect()
}
