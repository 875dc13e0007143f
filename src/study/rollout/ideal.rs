//! The loop whose law acts at every instant, beside a run.
//!
//! **Invariant:** the work of a step of the run is bounded.

use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::ControlLoop;

/// Longest step of Runge-Kutta 4 \[s\]: of the default arms it leaves errors of some 1e-12 rad.
const LONGEST_STEP: f64 = 2.5e-4;

/// Most of its steps in one of the run's: a run in longer ones learns that nothing is known.
const MOST_STEPS: u32 = 256;

/// The ideal loop, in whole parts of the run's timestep.
#[derive(Debug, Clone)]
pub(super) struct Ideal<const N: usize> {
    control: ContinuousLoop<N>,
    parts: u32,
    /// Parts that are left, to come to where the run is.
    behind: u64,
    is_lost: bool,
    evaluations: u64,
}

impl<const N: usize> Ideal<N> {
    /// The loop from `start` on, in steps that are `cuts` times shorter than they might be.
    pub(super) fn new(control: &ControlLoop<N>, start: State<N>, cuts: u32) -> Self {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast to an integer saturates, and the result is bounded"
        )]
        let parts = (control.timestep / LONGEST_STEP).ceil() as u32;
        let parts = parts.clamp(1, MOST_STEPS) * cuts;
        Self {
            control: ContinuousLoop {
                control: control
                    .with_method(Method::Rk4)
                    .with_timestep(control.timestep / f64::from(parts)),
                state: start,
                integral: [0.0; N],
            },
            parts,
            behind: 0,
            is_lost: false,
            evaluations: 0,
        }
    }

    /// Notes that the run has gone on by so many steps.
    pub(super) fn fall_behind(&mut self, steps: u64) {
        if !self.is_lost {
            self.behind += steps * u64::from(self.parts);
        }
    }

    /// Whether it has not come to where the run is.
    pub(super) fn is_behind(&self) -> bool {
        self.behind > 0
    }

    /// Follows the run with about `work` evaluations at most, and says with how many.
    pub(super) fn follow(&mut self, work: u64) -> u64 {
        let before = self.evaluations;
        while self.behind > 0 && self.evaluations - before < work {
            self.behind -= 1;
            self.evaluations += u64::from(Method::Rk4.evaluations());
            if !self.control.step() {
                self.is_lost = true;
                self.behind = 0;
            }
        }
        self.evaluations - before
    }

    /// Where it is, unless it was lost on the way.
    pub(super) fn state(&self) -> Option<&State<N>> {
        (!self.is_lost).then_some(&self.control.state)
    }

    pub(super) fn evaluations(&self) -> u64 {
        self.evaluations
    }
}
