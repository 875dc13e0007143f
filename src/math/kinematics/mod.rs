//! Forward kinematics, and inverse kinematics in closed form.
//!
//! `x = Σ lᵢ cos φᵢ`, `y = Σ lᵢ sin φᵢ`, `φᵢ = q₁ + … + qᵢ`; angles in rad, counter-clockwise, each relative to the
//! previous link; the base is the origin.
//!
//! | question | function | file |
//! | --- | --- | --- |
//! | where is the end effector? | [`forward()`], [`joints`], [`heading`] | `forward.rs` |
//! | which joint angles reach a target? | [`solve`] | `inverse.rs` |
//! | which of the angles that differ by whole turns? | [`wrap`], [`turn`], [`nearest_turn`] | `angle.rs` |
//!
//! **Invariant:** finite input gives a finite answer or an [`Unreachable`], never NaN, at any ratio of lengths.

mod angle;
mod forward;
mod inverse;

use super::shown::{Shown, shown_against};

pub use angle::{nearest_turn, turn, wrap};
/// A place in the plane \[m\]: `glam`'s vector, so that a caller needs no `glam` of the same version.
pub use glam::DVec2;

pub use forward::{EndEffector, forward, heading, joints};
pub use inverse::{BOUNDARY, solve};

/// A target of inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// The place for the end effector \[m\].
    pub position: DVec2,
    /// Orientation of the last link, `φₙ` \[rad\]. If it is absent, any possible one. Ignored for 2 links.
    pub orientation: Option<f64>,
}

/// The distances from the base \[m\] that the end effector of an arm can have: a ring, or a disc where `inner` is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Least distance \[m\]: the length of the longest link minus the sum of the others, or 0.
    pub inner: f64,
    /// Greatest distance \[m\]: the sum of the lengths.
    pub outer: f64,
}

impl Reach {
    /// The reach of links of these lengths \[m\], in any number and order.
    #[must_use]
    pub fn of(lengths: &[f64]) -> Self {
        let mut longest = 0.0;
        let mut rest = 0.0;
        for &length in lengths {
            if length > longest {
                rest += longest;
                longest = length;
            } else {
                rest += length;
            }
        }
        Self {
            inner: f64::max(0.0, longest - rest),
            outer: longest + rest,
        }
    }
}

/// Why no pose of the arm reaches a [`Target`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unreachable {
    /// The target is too far away.
    #[error(
        "target ({}, {}) is {} m from the base, beyond the arm's reach of {} m",
        Shown(*.x), Shown(*.y), shown_against(*.distance, *.limit), shown_against(*.limit, *.distance)
    )]
    Beyond {
        /// Target \[m\].
        x: f64,
        /// Target \[m\].
        y: f64,
        /// The target's distance from the base \[m\].
        distance: f64,
        /// Greatest distance that the arm reaches \[m\].
        limit: f64,
    },
    /// The target is too near: the other links cannot fold the longest link back so far (for 2 links:
    /// nearer than `|l1 - l2|`).
    #[error(
        "target ({}, {}) is {} m from the base, closer than the {} m to which the arm can fold",
        Shown(*.x), Shown(*.y), shown_against(*.distance, *.limit), shown_against(*.limit, *.distance)
    )]
    TooClose {
        /// Target \[m\].
        x: f64,
        /// Target \[m\].
        y: f64,
        /// The target's distance from the base \[m\].
        distance: f64,
        /// Least distance that the arm reaches \[m\].
        limit: f64,
    },
    /// With this orientation the last link would have to start beyond the reach of the others.
    #[error(
        "phi = {} puts the wrist {} m from the base, beyond the reach of links 1 and 2, {} m",
        Shown(*.phi), shown_against(*.distance, *.limit), shown_against(*.limit, *.distance)
    )]
    WristBeyond {
        /// Orientation asked for \[rad\].
        phi: f64,
        /// The wrist's distance from the base \[m\].
        distance: f64,
        /// `l1 + l2` \[m\].
        limit: f64,
    },
    /// With this orientation the last link would have to start nearer to the base than the others can fold.
    #[error(
        "phi = {} puts the wrist {} m from the base, closer than the {} m to which links 1 and 2 can fold",
        Shown(*.phi), shown_against(*.distance, *.limit), shown_against(*.limit, *.distance)
    )]
    WristTooClose {
        /// Orientation asked for \[rad\].
        phi: f64,
        /// The wrist's distance from the base \[m\].
        distance: f64,
        /// `|l1 - l2|` \[m\].
        limit: f64,
    },
    /// A coordinate, or the orientation of a 3-link arm, is not finite.
    #[error("{0} must be finite")]
    NotFinite(
        /// Its name in the request: `x`, `y` or `phi`.
        &'static str,
    ),
    /// A closed form exists only for 2 and 3 links.
    #[error("inverse kinematics is solved for 2 or 3 links, not {0}")]
    Links(
        /// The requested number of links.
        usize,
    ),
}
