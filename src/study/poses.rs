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

/// The smallest of `bound` and the limits of all poses; `None` if nothing limits.
pub(super) fn minimum_over_poses<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    method: Method,
    sampling: Sampling,
    bound: Option<f64>,
) -> Option<f64> {
    let mut smallest = bound;
    let integrating = gains.ki.map(|ki| ki > 0.0);
    let mut judge = |linear: &Linear, gravity: bool| {
        let stepping = Stepping::new(linear, method, sampling);
        let passes = smallest.is_some_and(|limit| {
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
            smallest = Some(smallest.map_or(limit, |smallest| smallest.min(limit)));
        }
    };
    for mut pose in outer_poses::<N>() {
        let linear = Linear::at(arm, gains, &pose, &integrating);
        if arm.gravity() == 0.0 {
            judge(&linear, false);
            continue;
        }
        judge(&linear.weightless(), false);
        for direction in 0..DIRECTIONS {
            if let Some(first) = pose.first_mut() {
                *first = part_of_turn(direction, DIRECTIONS);
            }
            judge(&Linear::at(arm, gains, &pose, &integrating), true);
        }
    }
    smallest
}

/// Poses of the outer joints, the first joint at zero. Mirrored about the vertical an arm is the same arm, so the second
/// joint needs half of its circle only.
fn outer_poses<const N: usize>() -> impl Iterator<Item = [f64; N]> {
    let half = GRID / 2 + 1;
    let outer = u32::try_from(N.saturating_sub(2)).unwrap_or(u32::MAX);
    let all = if N < 2 {
        1
    } else {
        half.saturating_mul(GRID.saturating_pow(outer))
    };
    let taken = all.min(MAX_POSES);
    (0..taken).map(move |index| {
        // Beyond three links the grid is thinned evenly.
        let mut index = index.saturating_mul(all / taken);
        std::array::from_fn(|joint| match joint {
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
        })
    })
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
