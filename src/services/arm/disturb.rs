//! `/arm_sim/disturb`: a disturbance.
//!
//! **Invariant:** a refused disturbance does not change the arm.

use bytes::Bytes;

use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::Address;

/// The reason for a refusal after a divergence.
pub(crate) const DIVERGED: &str =
    "is refused: the simulation has diverged; /arm_sim/reset clears this";

request! {
    /// Adds an effort to that of every step for some time, from the next one on. Refused if a field was rejected, or if
    /// the simulation has diverged.
    pub struct Disturb<N> -> Result<Push<N>, Rejections>, |fields| {
        /// \[N m\].
        effort: Option<[f64; N]> = fields.array("effort", Bound::Finite),
        /// Simulation time \[s\], greater than 0.
        duration: Option<f64> = fields.number("duration", Bound::Positive),
    }

    fn write(answer: Result<Push<N>, Rejections>, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|push| {
            object! {
                effort: push.effort.as_slice(),
                duration: push.duration,
            }
        }))
    }
}

/// A disturbance that has begun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push<const N: usize> {
    /// \[N m\].
    pub effort: [f64; N],
    /// Simulation time \[s\].
    pub duration: f64,
}
