//! The local error of a step, by step doubling: one step of `h` against two of `h/2` from the same state.
//!
//! A step of order p is off by `C h^(p+1)`, two half steps by `2 C (h/2)^(p+1)`; their difference is `1 - 2^-p` of the
//! whole, so `error = |x_h - x_(h/2)| 2^p / (2^p - 1)`. The effort is the one that the control law holds for the step, frozen
//! in both: the error is the method's own, not that of the sampled law.
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.4.
//!
//! **Invariant:** the simulation looked at is not changed. An estimate costs three steps.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::{Increment, Method, increment};
use crate::math::simulation::Simulation;

/// What one step is off by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorEstimate {
    /// Largest error of a joint position after the step \[rad\].
    pub local_error: f64,
    /// Largest error of a joint velocity after the step \[rad/s\].
    pub velocity_error: f64,
    /// `local_error` per timestep \[rad/s\]: how fast the error grows where the motion neither mends nor amplifies it.
    pub error_per_second: f64,
}

/// The error of the step that a simulation is about to take; `None` if that step is not finite, or a thing of the past.
#[must_use]
pub fn estimate<const N: usize>(simulation: &Simulation<N>) -> Option<ErrorEstimate> {
    if simulation.divergence().is_some() {
        return None;
    }
    let effort = simulation.effort_of_next_step();
    estimate_step(
        simulation.arm(),
        simulation.state(),
        &effort,
        simulation.method(),
        simulation.timestep(),
    )
}

/// The error of a step of `h` \[s\] from `state` under the constant `effort` \[N m\]; `None` if it is not finite.
#[must_use]
pub fn estimate_step<const N: usize>(
    arm: &Arm<N>,
    state: &State<N>,
    effort: &[f64; N],
    method: Method,
    h: f64,
) -> Option<ErrorEstimate> {
    let step = |state: &State<N>, h: f64| -> Increment<N> {
        increment(
            method,
            |_, q, v| forward_dynamics(arm, q, v, effort),
            0.0,
            &state.position,
            &state.velocity,
            h,
        )
    };
    let (whole_q, whole_v) = step(state, h);
    let (first_q, first_v) = step(state, 0.5 * h);
    let middle = State {
        position: std::array::from_fn(|i| state.position[i] + first_q[i]),
        velocity: std::array::from_fn(|i| state.velocity[i] + first_v[i]),
    };
    let (second_q, second_v) = step(&middle, 0.5 * h);
    let doubled = f64::from(1_u32 << method.order());
    // Differences of increments, not of states: a wound joint would drown them.
    let off = |whole: &[f64; N], first: &[f64; N], second: &[f64; N]| {
        (0..N)
            .map(|i| (whole[i] - (first[i] + second[i])).abs() * doubled / (doubled - 1.0))
            .fold(0.0, |max: f64, error| {
                if error > max || error.is_nan() {
                    error
                } else {
                    max
                }
            })
    };
    let local_error = off(&whole_q, &first_q, &second_q);
    let velocity_error = off(&whole_v, &first_v, &second_v);
    let error_per_second = local_error / h;
    let finite = local_error.is_finite() && velocity_error.is_finite();
    (finite && error_per_second.is_finite()).then_some(ErrorEstimate {
        local_error,
        velocity_error,
        error_per_second,
    })
}
