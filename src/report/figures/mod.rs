//! The sections of the report, one file each: compute, draw, say what was found.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod conditioning;
mod drift;
mod error;
mod nonlinear;
mod scenarios;
mod stability;
mod stiff;
mod work;

use super::section::Section;
use crate::math::count::length_in_f64;

/// How a section is made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maker {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// About how many seconds it takes.
    pub(crate) weight: f64,
    /// Whether it measures times: two such sections are never made side by side.
    pub(crate) timed: bool,
    pub(crate) make: fn(&mut Section),
}

impl Maker {
    const fn new(
        name: &'static str,
        title: &'static str,
        weight: f64,
        make: fn(&mut Section),
    ) -> Self {
        Self {
            name,
            title,
            weight,
            timed: false,
            make,
        }
    }

    const fn timed(self) -> Self {
        Self {
            timed: true,
            ..self
        }
    }
}

/// All sections in the order in which they are shown.
pub(crate) const SECTIONS: &[Maker] = &[
    Maker::new("error", "Error against cost", 40.0, error::make).timed(),
    Maker::new("stability", "Where it goes unstable", 12.0, stability::make),
    Maker::new(
        "nonlinear",
        "Where large motions go unstable",
        15.0,
        nonlinear::make,
    ),
    Maker::new("stiff", "Where explicit methods end", 12.0, stiff::make).timed(),
    Maker::new(
        "scenarios",
        "Stiff and extreme scenes",
        8.0,
        scenarios::make,
    ),
    Maker::new("budget", "Where an error comes from", 22.0, budget::make),
    Maker::new("drift", "Energy over long swings", 4.0, drift::make),
    Maker::new("conditioning", "Uneven arms", 1.0, conditioning::make),
    Maker::new(
        "work",
        "What a scene does not need is left out",
        5.0,
        work::make,
    )
    .timed(),
];

/// Slope of the least-squares line through `(log x, log y)` of positive numbers; `None` for fewer than two.
fn slope(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = length_in_f64(logs.len());
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let along: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    (logs.len() > 1).then(|| along / spread)
}

/// The edges of `count` cells from `low` to `high`, each as many times as large as the one before.
fn edges((low, high): (f64, f64), count: usize) -> Vec<f64> {
    let part = |index: usize| length_in_f64(index) / length_in_f64(count);
    let edges = (0..=count).map(|index| low * (high / low).powf(part(index)));
    edges.collect()
}

/// The geometric middle of each cell.
fn centres(edges: &[f64]) -> Vec<f64> {
    let pairs = edges.windows(2);
    pairs
        .map(|pair| pair.iter().product::<f64>().sqrt())
        .collect()
}

/// The largest of `values`; infinite if one is not a number.
fn worst(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |worst, value| match value {
        value if value.is_nan() => f64::INFINITY,
        value => worst.max(value),
    })
}
