//! The sections of the report, one file each: computation, figures and findings.
//!
//! **Invariant:** a section depends on no other section's results.

mod budget;
mod conditioning;
mod design;
mod drift;
mod error;
mod fit;
mod nonlinear;
mod scenarios;
mod stability;
mod stiff;
mod work;

use super::section::Section;

/// The function that makes a section, with its name and title.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maker {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// Whether it measures times: two such sections never run in parallel.
    pub(crate) timed: bool,
    pub(crate) make: fn(&mut Section),
}

const fn timed(name: &'static str, title: &'static str, make: fn(&mut Section)) -> Maker {
    Maker {
        timed: true,
        ..untimed(name, title, make)
    }
}

const fn untimed(name: &'static str, title: &'static str, make: fn(&mut Section)) -> Maker {
    Maker {
        name,
        title,
        timed: false,
        make,
    }
}

/// All sections in the order in which they are shown.
pub(crate) const SECTIONS: &[Maker] = &[
    timed("error", "Error against cost", error::make),
    untimed("stability", "Limits of stability", stability::make),
    untimed("nonlinear", "Stability of large motions", nonlinear::make),
    timed("stiff", "Stiffness and explicit methods", stiff::make),
    untimed("scenarios", "Stiff and extreme scenes", scenarios::make),
    untimed("design", "Control designed for its period", design::make),
    untimed("budget", "Parts of the error", budget::make),
    untimed("drift", "Energy over long swings", drift::make),
    untimed("conditioning", "Uneven arms", conditioning::make),
    untimed("work", "Work that is left out", work::make),
];
