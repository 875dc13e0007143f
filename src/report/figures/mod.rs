//! The sections of the report, one file each: compute, draw, say what was found.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod conditioning;
mod drift;
mod error;
mod horizon;
mod scenarios;
mod slope;
mod stability;
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
    pub(crate) make: fn(&mut Making<'_>) -> Section,
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
