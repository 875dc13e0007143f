//! Shared by scenes: settings, random states, growth rates.
//!
//! **Invariant:** what is random comes from a seed in the source, so a scene does the same every time.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::Observation;
use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::Simulation;
use crate::report::experiments::reference::{DoubleDouble, exact_acceleration, largest_difference};
use crate::study::control_loop::ControlLoop;
use crate::study::matrix::largest;

/// Unit roundoff: half a unit in the last place of 1.
pub(super) const ROUND_OFF: f64 = f64::EPSILON / 2.0;

pub(super) fn verdict(holds: bool, observed: String) -> Observation {
    Observation { observed, holds }
}

/// A number as a table shows it.
pub(super) fn short(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:.4e}"))
}

/// Links of 1 m and 1 kg, held with these gains in this pose, by Runge-Kutta 4 at a millisecond.
pub(super) fn held<const N: usize>(gains: Gains<N>, pose: [f64; N]) -> ControlLoop<N> {
    ControlLoop::new(Arm::default(), gains, Setpoint::at(pose))
}

/// An arm of links of 1 m; `None` for masses or a gravity that no arm has, which no scene but the refusals asks for.
pub(super) fn arm<const N: usize>(masses: [f64; N], gravity: f64) -> Option<Arm<N>> {
    Arm::new([1.0; N], masses, gravity).ok()
}

/// An arm left to itself, through the live loop.
pub(super) fn free<const N: usize>(
    arm: Arm<N>,
    start: State<N>,
    method: Method,
    timestep: f64,
) -> Simulation<N> {
    ControlLoop::free(arm)
        .with_method(method)
        .with_timestep(timestep)
        .simulation(start)
}

/// Largest difference of positions \[rad\] and velocities \[rad/s\].
pub(super) fn apart<const N: usize>(a: &State<N>, b: &State<N>) -> f64 {
    largest((0..N).flat_map(|i| {
        [
            (a.position[i] - b.position[i]).abs(),
            (a.velocity[i] - b.velocity[i]).abs(),
        ]
    }))
}

/// Repeatable numbers from -1 to 1: Marsaglia's 64-bit xorshift, mapped to the high bits.
pub(super) struct Noise(u64);

impl Noise {
    pub(super) const fn new() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    #[allow(clippy::cast_precision_loss, reason = "53 bits fit a double exactly")]
    pub(super) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(super) fn array<const N: usize>(&mut self, scale: f64) -> [f64; N] {
        std::array::from_fn(|_| scale * self.next())
    }
}

/// Decimal digits that the worst of `states` loses in its joint accelerations, against the same in twice the digits.
pub(super) fn digits_lost<const N: usize>(arm: &Arm<N>, states: &[State<N>]) -> f64 {
    let mut noise = Noise::new();
    largest(states.iter().map(|state| {
        let effort = noise.array(10.0);
        let State { position, velocity } = state;
        let found = forward_dynamics(arm, position, velocity, &effort);
        let exact = exact_acceleration(arm, state, &effort);
        let size = largest(
            exact
                .map(DoubleDouble::to_f64)
                .iter()
                .map(|exact| exact.abs()),
        );
        (largest_difference(&exact, &found) / size / ROUND_OFF)
            .max(1.0)
            .log10()
    }))
}

/// Two hundred random states around a pose, angles within `spread` \[rad\], rates within 2 rad/s.
pub(super) fn states<const N: usize>(pose: [f64; N], spread: f64) -> Vec<State<N>> {
    let mut noise = Noise::new();
    (0..200)
        .map(|_| {
            let off: [f64; N] = noise.array(spread);
            State {
                position: std::array::from_fn(|i| {
                    // The first joint turns everywhere.
                    if i == 0 {
                        pose[i] + 3.0 * noise.next()
                    } else {
                        pose[i] + off[i]
                    }
                }),
                velocity: noise.array(2.0),
            }
        })
        .collect()
}
