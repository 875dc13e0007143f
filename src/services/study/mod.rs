//! `/study/*` and `/arm_sim/integration_step`: predictions and offline runs, without effect on the live arm.
//!
//! A missing value is the arm's at the start of the computation. The arm does not change.
//!
//! **Invariant:** a computation is done in pieces, each of a fraction of a millisecond.

mod advice;
mod held_limit;
mod integration;
mod rollout;
mod stability;

use std::time::Duration;

pub use self::advice::{PlanRun, PlannedRun, SuggestGains, Suggested};
pub use self::held_limit::FindHeldLimit;
pub use self::integration::{Integrating, IntegrationStep, NotIntegrated};
pub use self::rollout::{Ran, RolloutWork, RunAnswer, RunOffline};
pub use self::stability::{PredictStability, Predicted};
use super::Ask;
use super::arm::SetParams;
use crate::math::arm::State;
use crate::math::arm::{Arm, ArmError};
use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields};
use crate::study::control_loop::ControlLoop;
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

/// The arm's settings at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Present<const N: usize> {
    /// The loop with the present gains, even if the controller is off.
    pub control: ControlLoop<N>,
    /// The arm's positions and velocities.
    pub state: State<N>,
}

/// The present control period, with another length \[s\] and delay if they are given.
fn with_period(present: ControlPeriod, period: Option<f64>, delay: Option<bool>) -> ControlPeriod {
    ControlPeriod {
        period: period.unwrap_or(present.period),
        delay: delay.unwrap_or(present.delay),
    }
}

/// Whether an effort acts one period late: a number of whole periods, 0 or 1, or `false` and `true`.
fn delay(fields: &mut Fields<'_>) -> Option<bool> {
    let raw = fields.raw("delay")?;
    match raw.get() {
        "false" | "0" => Some(false),
        "true" | "1" => Some(true),
        _ => {
            fields.refuse(
                "delay",
                &format_args!("must be 0 or 1 periods, or a boolean"),
            );
            None
        }
    }
}

/// Joint values under one of two names; the second one is older.
fn joints<const N: usize>(
    fields: &mut Fields<'_>,
    [name, older]: [&'static str; 2],
) -> Option<[f64; N]> {
    let of_older = fields.array(older, Bound::Finite);
    fields.array(name, Bound::Finite).or(of_older)
}

/// The state of a request. Given positions without velocities are at rest; otherwise the present arm's count.
fn state_of<const N: usize>(
    position: Option<[f64; N]>,
    velocity: Option<[f64; N]>,
    present: &State<N>,
) -> State<N> {
    let missing = position.map_or(present.velocity, |_| [0.0; N]);
    State {
        position: position.unwrap_or(present.position),
        velocity: velocity.unwrap_or(missing),
    }
}

/// The present arm, with the given parameters in place of its own.
fn arm_of<const N: usize>(
    params: Option<&SetParams<N>>,
    present: Arm<N>,
) -> Result<Arm<N>, ArmError> {
    params.map_or(Ok(present), |params| params.applied_to(&present))
}
