//! Simulation time, and how far it can go.
//!
//! **Invariant:** time is `base + k timestep`, never a running sum; every step leads to a later time, and a finite one.

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

    /// Whether a step leads to a later time: from 1e308 s on another 1e308 s is none, and at 1e18 s a millisecond is
    /// lost in rounding.
    #[must_use]
    pub fn has_later_time(&self) -> bool {
        let next = self.time_after(1);
        next.is_finite() && next > self.time()
    }

    /// Whether each of the next `steps` surely leads to a later time. It is asked once for all of them: if the timestep
    /// is more than four units in the last place of the time at the end, the roundings of product and sum cannot hold
    /// the clock anywhere on the way. No timestep is, if that time is infinite.
    pub(super) fn has_time_for(&self, steps: u64) -> bool {
        self.timestep > 4.0 * f64::EPSILON * self.time_after(steps)
    }

    /// Does what [`Simulation::advance_with`] does, near the end of time: asks before each step whether it leads to a
    /// later time.
    #[cold]
    pub(super) fn take_last_steps(
        &mut self,
        steps: u64,
        mut observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> u64 {
        for taken in 0..steps {
            if !self.has_later_time() {
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
