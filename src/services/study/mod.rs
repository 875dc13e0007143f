//! `/study/*`: predictions and offline runs of the arm, apart from the live arm.
//!
//! A value that a request leaves out is the arm's as it is when the computation begins; the arm is left as it is.
//!
//! **Invariant:** a computation is done a piece at a time, and each piece is a fraction of a millisecond.

mod advice;
mod reading;
mod rollout;
mod stability;

use std::time::Duration;

pub use self::advice::{NotPlanned, NotSuggested, PlanRun, PlannedRun, SuggestGains, Suggested};
pub use self::rollout::{NotRun, Ran, RolloutWork, RunOffline};
pub use self::stability::{PredictStability, Predicted};
use super::Ask;
use crate::math::arm::State;
use crate::study::control_loop::ControlLoop;
use crate::study::paused::Paused;

/// The longest number and the comma behind it, and the number itself while the answer is computed.
pub(crate) const NUMBER_BYTES: usize = 25 + 8;

/// The work that a call asks for, done a piece at a time.
pub trait Work<T>: Send {
    /// The most bytes that the answer and its computation can take together; it is asked before the work begins.
    fn most_bytes(&self) -> usize;

    /// Does a piece, which is a fraction of a slice. Returns the answer after the last one. `clock` tells what work
    /// costs: only differences mean something.
    fn advance(&mut self, clock: fn() -> Duration) -> Option<T>;
}

/// A question whose answer is computed.
pub trait Computed<const N: usize>: Ask {
    /// The computation.
    type Work: Work<Self::Answer> + 'static;

    /// The work that this asks for, of an arm that is `present` so.
    #[must_use]
    fn work(self, present: Present<N>) -> Self::Work;
}

/// A computation of the study, which needs no clock.
pub struct StudyWork<T> {
    most_bytes: usize,
    computation: Paused<T>,
}

impl<T> Work<T> for StudyWork<T> {
    fn most_bytes(&self) -> usize {
        self.most_bytes
    }

    fn advance(&mut self, _: fn() -> Duration) -> Option<T> {
        self.computation.advance()
    }
}

/// The arm's settings at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Present<const N: usize> {
    /// The loop, with the gains as they are set, whether the controller is on or off.
    pub control: ControlLoop<N>,
    /// The arm's positions and velocities.
    pub state: State<N>,
}
