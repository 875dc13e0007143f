//! The sections of the report, one file each: compute, draw, say what was found.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod cells;
mod conditioning;
mod drift;
mod error;
mod floquet;
mod nonlinear;
mod scenarios;
mod slope;
mod stability;
mod stiff;
mod work;

use super::making::Making;
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
    pub(crate) make: fn(&mut Making<'_>) -> Section,
}

/// All sections in the order in which they are shown.
pub(crate) const SECTIONS: &[Maker] = &[
    Maker {
        name: "error",
        title: "Error against cost",
        weight: 40.0,
        timed: true,
        make: error::make,
    },
    Maker {
        name: "stability",
        title: "Where it goes unstable",
        weight: 12.0,
        timed: false,
        make: stability::make,
    },
    Maker {
        name: "nonlinear",
        title: "Where large motions go unstable",
        weight: 15.0,
        timed: false,
        make: nonlinear::make,
    },
    Maker {
        name: "stiff",
        title: "Where explicit methods end",
        weight: 12.0,
        timed: true,
        make: stiff::make,
    },
    Maker {
        name: "scenarios",
        title: "Stiff and extreme scenes",
        weight: 8.0,
        timed: false,
        make: scenarios::make,
    },
    Maker {
        name: "budget",
        title: "Where an error comes from",
        weight: 22.0,
        timed: false,
        make: budget::make,
    },
    Maker {
        name: "drift",
        title: "Energy over long swings",
        weight: 4.0,
        timed: false,
        make: drift::make,
    },
    Maker {
        name: "conditioning",
        title: "Uneven arms",
        weight: 1.0,
        timed: false,
        make: conditioning::make,
    },
    Maker {
        name: "work",
        title: "What a scene does not need is left out",
        weight: 5.0,
        timed: true,
        make: work::make,
    },
];
