//! The sections of the report, one file each: compute, draw, say what was found.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod conditioning;
mod drift;
mod error;
mod horizon;
mod scenarios;
mod stability;
mod work;

use super::Desk;
use super::section::Section;

/// How a section is made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maker {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// About how many seconds it takes.
    pub(crate) weight: f64,
    pub(crate) make: fn(&mut Desk<'_>) -> Section,
}

/// All sections in the order in which they are made and shown.
pub(crate) const SECTIONS: [Maker; 8] = [
    Maker {
        name: "error",
        title: "Error against cost",
        weight: 115.0,
        make: error::make,
    },
    Maker {
        name: "stability",
        title: "Where it goes unstable",
        weight: 12.0,
        make: stability::make,
    },
    Maker {
        name: "scenarios",
        title: "Stiff and extreme scenes",
        weight: 8.0,
        make: scenarios::make,
    },
    Maker {
        name: "budget",
        title: "Where an error comes from",
        weight: 22.0,
        make: budget::make,
    },
    Maker {
        name: "drift",
        title: "Energy over long swings",
        weight: 4.0,
        make: drift::make,
    },
    Maker {
        name: "horizon",
        title: "How far a chaotic swing can be followed",
        weight: 10.0,
        make: horizon::make,
    },
    Maker {
        name: "conditioning",
        title: "Uneven arms",
        weight: 1.0,
        make: conditioning::make,
    },
    Maker {
        name: "work",
        title: "What a scene does not need is left out",
        weight: 4.0,
        make: work::make,
    },
];

/// Slope of the least-squares line through `(log x, log y)`; `None` for fewer than two points.
pub(crate) fn slope(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    if logs.len() < 2 {
        return None;
    }
    #[allow(
        clippy::cast_precision_loss,
        reason = "counts of points are far below 2^53"
    )]
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let along: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    Some(along / spread)
}
