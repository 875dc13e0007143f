//! Requested steps of a paused arm.
//!
//! **Invariant:** a request is refused as a whole, before its first step.

use crate::math::simulation::Simulation;
use crate::protocol::op::fields::Rejections;
use crate::services::arm::{DIVERGED, Step, Stepped, StepsEnd};

/// Requested steps that are not all taken.
#[derive(Debug, Clone, Copy)]
pub struct StepsAsked<const N: usize> {
    pub(super) asked: u64,
    pub(super) taken: u64,
    /// The effort that is applied instead of the controller's \[N m\], if there is one.
    pub(super) effort: Option<[f64; N]>,
}

impl<const N: usize> StepsAsked<N> {
    /// Checks whether an arm in this state can be stepped.
    pub(super) fn begin(
        ask: Step<N>,
        is_paused: bool,
        has_diverged: bool,
    ) -> Result<Self, Rejections> {
        let mut rejected = ask.rejected;
        if !is_paused {
            rejected.refuse("steps", &"can be taken only while the arm is paused");
        } else if has_diverged {
            rejected.refuse("steps", &DIVERGED);
        }
        match ask.steps.filter(|_| rejected.is_empty()) {
            Some(asked) => Ok(Self {
                asked,
                taken: 0,
                effort: ask.effort,
            }),
            None => Err(rejected),
        }
    }

    /// The answer after the last step.
    pub(super) fn answer(&self, simulation: &Simulation<N>, end: StepsEnd) -> Stepped<N> {
        Stepped {
            steps: self.taken,
            time: simulation.time(),
            state: *simulation.state(),
            effort: *simulation.effort(),
            end,
        }
    }
}
