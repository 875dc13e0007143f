//! The end effector's pose, and the joint positions that put it somewhere: forward and closed-form inverse
//! kinematics.
//!
//! `x = Σ lᵢ cos φᵢ`, `y = Σ lᵢ sin φᵢ`, `φᵢ = q₁ + … + qᵢ`; angles in rad, counter-clockwise, each relative to the
//! previous link; the base is the origin.
//!
//! | question | function | file |
//! | --- | --- | --- |
//! | where is the end effector? | [`forward()`], [`joints`], [`heading`] | `forward.rs` |
//! | how must the joints stand? | [`solve`] | `inverse.rs` |
//! | which of all equal angles is meant? | [`wrap`], [`turn`], [`nearest_turn`] | `angle.rs` |
//!
//! **Invariant:** finite input gives a finite answer or an [`Unreachable`], never NaN, at any ratio of lengths.

mod angle;
mod forward;
mod inverse;

use glam::DVec2;

use super::shown::{Shown, shown_against};

pub use angle::{nearest_turn, turn, wrap};
pub use forward::{EndEffector, forward, heading, joints};
pub use inverse::{BOUNDARY, solve};

/// A target of inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// The place for the end effector \[m\].
    pub position: DVec2,
    /// Heading that the last link should have, `φₙ` \[rad\]; any that is possible where absent. Ignored for 2 links.
    pub orientation: Option<f64>,
}

/// The distances from the base \[m\] that the end effector of an arm can have: a ring, or a disc where `inner` is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Least distance \[m\]: the longest link less all the others together, or 0.
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

/// Why no pose of the arm answers a [`Target`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unreachable {
    /// The end effector can't be put so far away.
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
    /// The longest link can't be folded back so far by the others (for 2 links: nearer than `|l1 - l2|`).
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
    /// With this orientation the last link would have to start farther away than the others reach.
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
    /// With this orientation the last link would have to start nearer to the base than the others fold.
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
    /// A coordinate, or the orientation of a 3-link arm, is no number to aim at.
    #[error("{0} must be finite")]
    NotFinite(
        /// The request's name of it: `x`, `y` or `phi`.
        &'static str,
    ),
    /// There is a closed form for 2 and 3 links only.
    #[error("inverse kinematics is solved for 2 or 3 links, not {0}")]
    Links(
        /// Links asked for.
        usize,
    ),
}
