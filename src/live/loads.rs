//! The efforts that the arm's motors have reached, and the energy that friction has taken, counted step by step.
//!
//! **Invariant:** without limits and friction no step is counted.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::dynamics;
use crate::math::simulation::Simulation;

/// Counts since the latest message of `/diagnostics`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loads<const N: usize> {
    /// Steps in the present window, and those of them in which each joint was at its limit.
    steps: u64,
    at_limit: [u64; N],
    /// The shares of the last window that had steps.
    last: [f64; N],
    /// The state before the next counted step.
    before: State<N>,
    /// Energy that friction has taken since the energy's reference \[J\].
    pub(crate) friction: f64,
}

impl<const N: usize> Default for Loads<N> {
    fn default() -> Self {
        Self {
            steps: 0,
            at_limit: [0; N],
            last: [0.0; N],
            before: State::rest(),
            friction: 0.0,
        }
    }
}

impl<const N: usize> Loads<N> {
    /// Whether the steps must be counted.
    pub(crate) fn are_watched(simulation: &Simulation<N>) -> bool {
        simulation.limits().effort.is_some() || simulation.arm().has_friction()
    }

    /// Steps of the simulation follow.
    pub(crate) fn begin(&mut self, simulation: &Simulation<N>) {
        self.before = *simulation.state();
    }

    /// Counts a step.
    pub(crate) fn count(&mut self, simulation: &Simulation<N>) {
        self.steps += 1;
        for (count, is_reached) in self.at_limit.iter_mut().zip(simulation.at_limit()) {
            *count += u64::from(is_reached);
        }
        let (arm, after) = (simulation.arm(), simulation.state());
        if arm.has_friction() {
            self.friction +=
                dynamics::friction_loss(arm, &self.before, after, simulation.timestep());
        }
        self.before = *after;
    }

    /// The share of the steps in which each joint was at its limit: of this window if it is `long` enough, otherwise of
    /// the last one.
    pub(crate) fn shares(&self, long: bool) -> [f64; N] {
        if long && self.steps > 0 {
            self.at_limit
                .map(|count| in_f64(count) / in_f64(self.steps))
        } else {
            self.last
        }
    }

    /// Begins the next window.
    pub(crate) fn end_window(&mut self) {
        *self = Self {
            last: self.shares(true),
            steps: 0,
            at_limit: [0; N],
            ..*self
        };
    }

    /// Forgets the efforts, as after a change of the limits.
    pub(crate) fn restart(&mut self) {
        *self = Self {
            friction: self.friction,
            ..Self::default()
        };
    }
}
