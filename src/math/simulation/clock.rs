//! Simulation time and its limit.
//!
//! **Invariant:** time is `base + k timestep`, never a running sum, and finite.

use super::Simulation;
use crate::math::count::{in_f64, partition_point};

impl<const N: usize> Simulation<N> {
    /// Simulation time since the reset \[s\].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time_after(0)
    }

    /// Simulation time after `steps` more steps \[s\].
    pub(super) fn time_after(&self, steps: u64) -> f64 {
        self.base + in_f64(self.steps_since_base.saturating_add(steps)) * self.timestep
    }

    /// The number of `steps` that lead to a finite time. Inside the step loop this check would cost
    /// registers and two instructions per step.
    #[inline(never)]
    pub(super) fn steps_with_time(&self, steps: u64) -> u64 {
        // Times do not decrease from step to step, even with rounding.
        partition_point(steps, |step| self.time_after(step + 1).is_finite())
    }

    /// Changes the length of a step \[s\] from the next step on. Returns `false`, and changes nothing, if it is not finite
    /// and greater than 0. A control period begins with that
    /// step. Time continues from its present value. The present timestep changes nothing, so repeating it does not turn
    /// time into a running sum.
    pub fn set_timestep(&mut self, timestep: f64) -> bool {
        if !timestep.is_finite() || timestep <= 0.0 {
            return false;
        }
        if timestep.to_bits() != self.timestep.to_bits() {
            self.base = self.time();
            self.steps_since_base = 0;
            self.timestep = timestep;
            self.hold.begin_period(timestep, |_| ());
        }
        true
    }
}
