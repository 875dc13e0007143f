//! Simulation time, and how far it can go.
//!
//! **Invariant:** time is `base + k timestep`, never a running sum, and finite.

use std::ops::ControlFlow;

use super::Simulation;
use crate::math::count::in_f64;

impl<const N: usize> Simulation<N> {
    /// Simulation time since the reset \[s\].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time_after(0)
    }

    /// Simulation time when so many more steps will have been taken \[s\].
    pub(super) fn time_after(&self, steps: u64) -> f64 {
        self.base + in_f64(self.steps_since_base.saturating_add(steps)) * self.timestep
    }

    /// Whether so many more steps lead to a finite time, and so does each on the way: time does not fall from step to
    /// step, rounding included.
    #[must_use]
    pub fn has_time_for(&self, steps: u64) -> bool {
        self.time_after(steps).is_finite()
    }

    /// Does what [`Simulation::advance_with`] does where time ends before the last step: asks before each whether there
    /// is time for it.
    #[cold]
    pub(super) fn take_last_steps(
        &mut self,
        steps: u64,
        mut observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> u64 {
        for taken in 0..steps {
            if !self.has_time_for(1) {
                self.diverge();
                return taken;
            }
            let mut shown = ControlFlow::Continue(());
            let one = self.take_steps(1, |arm| {
                shown = observe(arm);
                shown
            });
            if one == 0 || shown.is_break() {
                return taken + one;
            }
        }
        steps
    }

    /// Changes the length of a step \[s\], greater than 0, from the next step on; time goes on from where it is. The
    /// timestep already in force changes nothing, so that repeating it does not turn time into a running sum.
    pub fn set_timestep(&mut self, timestep: f64) {
        if timestep.to_bits() != self.timestep.to_bits() {
            self.base = self.time();
            self.steps_since_base = 0;
            self.timestep = timestep;
        }
    }
}
