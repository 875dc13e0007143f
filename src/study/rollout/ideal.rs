//! The loop whose law acts at every instant, beside a run.
//!
//! **Invariant:** the work of a step of the run is bounded.

use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::ControlLoop;
use crate::study::paused::PieceWork;

/// Longest step of Runge-Kutta 4 \[s\]: of the default arms it leaves errors of some 1e-12 rad.
const LONGEST_STEP: f64 = 2.5e-4;

/// Most of its steps in one of the run's: a run in longer ones learns that nothing is known.
const MOST_STEPS: u32 = 256;

/// The ideal loop, in whole parts of the run's timestep.
#[derive(Debug, Clone)]
pub(super) struct Ideal<const N: usize> {
    control: ContinuousLoop<N>,
    parts: u32,
    is_lost: bool,
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
            control: ContinuousLoop::new(
                control
                    .with_method(Method::Rk4)
                    .with_timestep(control.timestep / f64::from(parts)),
                start,
                [0.0; N],
            ),
            parts,
            is_lost: false,
        }
    }

    /// Follows the run by this number of its steps.
    pub(super) async fn follow(&mut self, steps: u64, piece: &mut PieceWork) {
        for _ in 0..steps * u64::from(self.parts) {
            if self.is_lost {
                return;
            }
            self.is_lost = !self.control.step();
            piece.spend(Method::Rk4.evaluations().into()).await;
        }
    }

    /// Where it is, unless it was lost on the way.
    pub(super) fn state(&self) -> Option<&State<N>> {
        (!self.is_lost).then_some(&self.control.state)
    }
}
