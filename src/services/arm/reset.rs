//! `/arm_sim/reset`: returns to the starting pose at time 0.
//!
//! **Invariant:** the result of a goal that it ends is published before the answer.

use bytes::Bytes;

use crate::math::arm::State;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

/// Returns the arm to its starting pose at time 0, unless the request was rejected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reset<const N: usize> {
    /// A reset has no fields: the request is rejected as a whole.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for Reset<N> {
    type Answer = Echo<State<N>>;
}

impl<const N: usize> FieldByField for Reset<N> {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            rejected: fields.rejections(),
        }
    }
}

impl<const N: usize> Answered for Reset<N> {
    fn write(echo: Echo<State<N>>, to: &Address) -> Bytes {
        write_state(&echo, to)
    }
}

/// Writes the present state of the arm.
pub(super) fn write_state<const N: usize>(echo: &Echo<State<N>>, to: &Address) -> Bytes {
    let values = object! {
        position: echo.values.position.as_slice(),
        velocity: echo.values.velocity.as_slice(),
    };
    to.response(&values, &echo.rejected.status())
}
