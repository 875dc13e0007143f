//! What one step adds to a state, and how it is added.
//!
//! **Invariant:** an arm without gravity moves by the same bits, whichever of the two ways through the dynamics it takes.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `from_fn` over arrays of the same constant length"
)]

use std::array::from_fn;

use crate::math::arm::{Arm, State};
use crate::math::dynamics::{forward_dynamics, weightless_dynamics};
use crate::math::integrator::{Increment, Method, increment, two_sum};

/// What a step of `h` \[s\] under the constant `effort` \[N m\] adds to positions and velocities.
#[inline(always)]
#[must_use]
pub fn step_under<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> Increment<N> {
    if arm.gravity() == 0.0 {
        step_as::<N, false>(arm, method, state, effort, h)
    } else {
        step_as::<N, true>(arm, method, state, effort, h)
    }
}

/// [`step_under`], of an arm with gravity or without.
#[inline(always)]
pub(super) fn step_as<const N: usize, const WEIGHS: bool>(
    arm: &Arm<N>,
    method: Method,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> Increment<N> {
    let State { position, velocity } = state;
    // The motion does not depend on the time, so none is reckoned for the stages.
    let acceleration = |_, q: &[f64; N], v: &[f64; N]| {
        if WEIGHS {
            forward_dynamics(arm, q, v, effort)
        } else {
            weightless_dynamics(arm, q, v, effort)
        }
    };
    increment(method, acceleration, 0.0, position, velocity, h)
}

/// `value + carry + increment`, and the carry that rounding leaves for the next step.
#[inline(always)]
pub(super) fn add<const N: usize>(
    value: &[f64; N],
    carry: &[f64; N],
    increment: &[f64; N],
) -> ([f64; N], [f64; N]) {
    let sums: [(f64, f64); N] = from_fn(|i| two_sum(value[i], increment[i] + carry[i]));
    (sums.map(|sum| sum.0), sums.map(|sum| sum.1))
}
