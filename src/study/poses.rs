//! The smallest stable timestep over all poses: how far a limit at one setpoint can be trusted on the way to another.
//!
//! Inertia depends on every joint but the first, the pull of gravity on all of them. At every pose of a grid over the outer
//! joints the loop is judged without gravity, and, where there is gravity, at a ring of first joints with it. Poses that
//! gravity makes run away even in continuous time say nothing about timesteps and are left out; without gravity they
//! count, since then it is the gains that run away.
//!
//! **Invariant:** the work is bounded: [`GRID`] poses a joint, and beyond three links fewer.

#![allow(
    clippy::indexing_slicing,
    reason = "digits are taken modulo the grid's own length"
)]

use std::f64::consts::{PI, TAU};

use super::linear::Linear;
use super::stability::{Modes, Sampling, Stepping};
use crate::math::arm::Arm;
use crate::math::integrator::Method;
use crate::math::pid::Gains;

/// Poses around the circle of each outer joint; even, so that stretched and folded are among them.
const GRID: usize = 16;

/// Directions of the first joint for the pull of gravity; among them hanging and upright.
const DIRECTIONS: usize = 8;

/// Most poses of the outer joints, whatever the number of links.
const MAX_POSES: usize = 1024;

/// Parts of the smallest limit so far at which a pose must be stable to pass without a search of its own.
const PROBES: [f64; 3] = [1.0, 0.6, 0.2];

/// The smallest of a bound and the limits of all poses, looked for pose by pose, so that it can be paused.
#[derive(Debug, Clone)]
pub(super) struct PoseSearch<const N: usize> {
    arm: Arm<N>,
    gains: Gains<N>,
    method: Method,
    sampling: Sampling,
    /// The smallest so far \[s\]; `None` while nothing limits.
    smallest: Option<f64>,
    /// Judgements made.
    judged: usize,
}

impl<const N: usize> PoseSearch<N> {
    /// A search that begins with `bound` \[s\], the limit at some other pose.
    pub(super) fn new(
        arm: &Arm<N>,
        gains: &Gains<N>,
        method: Method,
        sampling: Sampling,
        bound: Option<f64>,
    ) -> Self {
        Self {
            arm: *arm,
            gains: *gains,
            method,
            sampling,
            smallest: bound,
            judged: 0,
        }
    }

    /// Judges the loop at one more pose; false once there is none left.
    pub(super) fn advance(&mut self) -> bool {
        let directions = if self.arm.gravity() == 0.0 {
            0
        } else {
            DIRECTIONS
        };
        // Without gravity the direction of the first joint makes no difference: one judgement, then one for each.
        let (index, turn) = (
            self.judged / (directions + 1),
            self.judged % (directions + 1),
        );
        let Some(mut pose) = outer_pose::<N>(index) else {
            return false;
        };
        self.judged += 1;
        if turn > 0
            && let Some(first) = pose.first_mut()
        {
            *first = part_of_turn(turn - 1, DIRECTIONS);
        }
        let integrating = self.gains.ki.map(|ki| ki > 0.0);
        let linear = Linear::at(&self.arm, &self.gains, &pose, &integrating);
        if turn > 0 {
            self.judge(&linear, true);
        } else {
            self.judge(&linear.weightless(), false);
        }
        true
    }

    /// The smallest so far \[s\]; `None` if nothing limits.
    pub(super) fn smallest(&self) -> Option<f64> {
        self.smallest
    }

    fn judge(&mut self, linear: &Linear, gravity: bool) {
        let stepping = Stepping::new(linear, self.method, self.sampling);
        let passes = self.smallest.is_some_and(|limit| {
            PROBES
                .iter()
                .all(|part| limit == 0.0 || stepping.is_stable(part * limit))
        });
        if passes {
            return;
        }
        let modes = Modes::of(linear);
        if gravity && modes.run_away() {
            return;
        }
        if let Some(limit) = stepping.search(&modes) {
            self.smallest = Some(self.smallest.map_or(limit, |smallest| smallest.min(limit)));
        }
    }
}

/// One of the poses of the outer joints, the first joint at zero; none beyond the last. Mirrored about the vertical an arm
/// is the same arm, so the second joint needs half of its circle only.
fn outer_pose<const N: usize>(index: usize) -> Option<[f64; N]> {
    let half = GRID / 2 + 1;
    let outer = u32::try_from(N.saturating_sub(2)).unwrap_or(u32::MAX);
    let all = if N < 2 {
        1
    } else {
        half.saturating_mul(GRID.saturating_pow(outer))
    };
    let taken = all.min(MAX_POSES);
    // Beyond three links the grid is thinned evenly.
    let mut index = (index < taken).then(|| index.saturating_mul(all / taken))?;
    Some(std::array::from_fn(|joint| match joint {
        0 => 0.0,
        1 => {
            let digit = index % half;
            index /= half;
            PI * ratio(digit, GRID / 2)
        }
        _ => {
            let digit = index % GRID;
            index /= GRID;
            part_of_turn(digit, GRID)
        }
    }))
}

/// `part / whole` of a turn, from -π \[rad\].
fn part_of_turn(part: usize, whole: usize) -> f64 {
    TAU * ratio(part, whole) - PI
}

#[allow(
    clippy::cast_precision_loss,
    reason = "grid indices are far below 2^53"
)]
fn ratio(part: usize, whole: usize) -> f64 {
    part as f64 / whole as f64
}
