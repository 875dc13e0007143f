//! The sections of the report, one file each: compute, draw, say what was found.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod conditioning;
mod drift;
mod error;
mod fit;
mod nonlinear;
mod scenarios;
mod stability;
mod stiff;
mod work;

use super::section::Section;

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
