//! `/study/*` and `/arm_sim/integration_step`: predictions and offline runs, without effect on the live arm.
//!
//! A missing value is the arm's at the start of the computation. The arm does not change.
//!
//! **Invariant:** a computation is done in pieces, each of a fraction of a millisecond.

mod advice;
mod held_limit;
mod integration;
mod method;
mod question;
mod rollout;
mod stability;

use std::time::Duration;

pub use self::advice::{PlanRun, PlannedRun, SuggestGains, Suggested};
pub use self::held_limit::FindHeldLimit;
pub use self::integration::{Integrating, IntegrationStep, NotIntegrated};
pub use self::method::{AnalyseMethod, Analysed, Beside};
pub use self::question::{Changed, Present};
pub use self::rollout::{Ran, RolloutWork, RunAnswer, RunOffline};
pub use self::stability::{PredictStability, Predicted};
use super::Ask;
use crate::math::arm::ArmError;
use crate::study::paused::Paused;
use crate::study::stability::most_bytes;

/// Bytes of the longest number with its comma, and of the number itself while the answer is computed.
pub(crate) const NUMBER_BYTES: usize = 25 + 8;

/// The computation of a call, done in pieces.
pub trait Work<T>: Send {
    /// The most bytes of the answer and its computation together. It is called before the computation begins.
    fn most_bytes(&self) -> usize;

    /// Computes one piece, a fraction of a slice. Returns the answer after the last one. `clock` measures the run
    /// time; only differences count.
    fn advance(&mut self, clock: fn() -> Duration) -> Option<T>;
}

/// A question whose answer is computed.
pub trait Computed<const N: usize>: Ask {
    /// The computation.
    type Work: Work<Self::Answer> + 'static;

    /// The computation of this request for the `present` arm.
    #[must_use]
    fn work(self, present: Present<N>) -> Self::Work;
}

/// Why a computation has no result.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refused<E> {
    /// The arm is not valid.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// The reason of the study.
    #[error(transparent)]
    Study(E),
}

/// A computation of the study, which needs no clock.
pub struct StudyWork<T> {
    most_bytes: usize,
    computation: Paused<T>,
}

impl<T> StudyWork<T> {
    /// A computation for an arm of `N` links that searches over its poses.
    fn new<const N: usize>(computation: impl Future<Output = T> + Send + 'static) -> Self {
        Self {
            most_bytes: most_bytes::<N>(),
            computation: Paused::new(computation),
        }
    }
}

impl<T> Work<T> for StudyWork<T> {
    fn most_bytes(&self) -> usize {
        self.most_bytes
    }

    fn advance(&mut self, _: fn() -> Duration) -> Option<T> {
        self.computation.advance()
    }
}
