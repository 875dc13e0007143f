//! The increments of one step, and how they are added to a state.
//!
//! **Invariant:** an arm without gravity moves by the same bits, whichever of the two ways through the dynamics it
//! takes.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `from_fn` over arrays of the same constant length"
)]

use std::array::from_fn;

use crate::math::arm::{Arm, State};
use crate::math::dynamics::{forward_dynamics, weightless_dynamics};
use crate::math::integrator::{Increment, Method, increment, two_sum};

/// The increments of positions and velocities in a step of `h` \[s\] under the constant `effort` \[N m\].
#[inline(always)]
#[must_use]
pub fn step_under<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> Increment<N> {
    if leaves_out_first_angle(arm) {
        step_as::<N, false>(arm, method, state, effort, h)
    } else {
        step_as::<N, true>(arm, method, state, effort, h)
    }
}

/// Whether the dynamics can do without the first angle, and gain by it: sines and cosines are taken two at a time, so
/// that an odd number of angles less one is a whole pass less. With 2 links next to nothing is saved.
#[inline(always)]
pub(super) fn leaves_out_first_angle<const N: usize>(arm: &Arm<N>) -> bool {
    N % 2 == 1 && arm.gravity() == 0.0
}

/// [`step_under`], of an arm that needs its first angle or does not.
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
