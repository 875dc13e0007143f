//! Lines through points, and quantiles.
//!
//! **Invariant:** pure.

/// A straight line through points, by least squares.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Rise per unit.
    pub slope: f64,
    /// Standard error of the slope, from the residuals; NaN for fewer than three points.
    pub error: f64,
}

/// The line through `points`, if there are two at least at different places.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let (sum_x, sum_y) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let spread: f64 = points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    if points.len() < 2 || spread == 0.0 {
        return None;
    }
    let slope = points
        .iter()
        .map(|(x, y)| (x - mean_x) * (y - mean_y))
        .sum::<f64>()
        / spread;
    let residual = |(x, y): &(f64, f64)| (y - mean_y - slope * (x - mean_x)).powi(2);
    let scatter = points.iter().map(residual).sum::<f64>() / (n - 2.0);
    Some(Line {
        slope,
        error: (scatter / spread).sqrt(),
    })
}

/// The value below which `share` of the sorted values are; NaN if there are none.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = ((sorted.len() as f64 - 1.0) * share).round().max(0.0) as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// The values in rising order.
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}
