//! `/arm_sim/disturb`: a disturbance.
//!
//! **Invariant:** a refused disturbance does not change the arm.

use bytes::Bytes;

use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, FieldByField};

/// The reason for a refusal after a divergence.
pub(crate) const DIVERGED: &str =
    "is refused: the simulation has diverged; /arm_sim/reset clears this";

/// Adds an effort to that of every step for some time, from the next one on. Refused if a field was rejected, or if
/// the simulation has diverged.
#[derive(Debug, Clone, PartialEq)]
pub struct Disturb<const N: usize> {
    /// \[N m\].
    pub effort: Option<[f64; N]>,
    /// Simulation time \[s\], greater than 0.
    pub duration: Option<f64>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// A disturbance that has begun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push<const N: usize> {
    /// \[N m\].
    pub effort: [f64; N],
    /// Simulation time \[s\].
    pub duration: f64,
}

impl<const N: usize> Ask for Disturb<N> {
    type Answer = Result<Push<N>, Rejections>;
}

impl<const N: usize> FieldByField for Disturb<N> {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            effort: fields.array("effort", Bound::Finite),
            duration: fields.number("duration", Bound::Positive),
            rejected: fields.rejections(),
        }
    }
}

impl<const N: usize> Answered for Disturb<N> {
    fn write(answer: Result<Push<N>, Rejections>, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|push| {
            object! {
                effort: push.effort.as_slice(),
                duration: push.duration,
            }
        }))
    }
}
