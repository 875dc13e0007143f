//! `/arm_sim/reset`: returns to the starting pose at time 0.
//!
//! **Invariant:** the result of a goal that it ends is published before the answer.

use bytes::Bytes;

use crate::math::arm::State;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Returns the arm to its starting pose at time 0, unless the request was rejected. It has no fields, so it is
    /// rejected as a whole.
    pub struct Reset<N> -> Echo<State<N>>, |fields| {}

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
