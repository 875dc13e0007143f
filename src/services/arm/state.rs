//! `/arm_sim/set_state`: puts the arm into another state.
//!
//! **Invariant:** clock, setpoint, integral, gains and an active goal do not change.

use bytes::Bytes;

use super::reset::write_state;
use crate::math::arm::State;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets positions and velocities, running or paused, and ends a divergence.
    pub struct SetState<N> -> Echo<State<N>>, |fields| {
        /// Joint positions \[rad\].
        position: Option<[f64; N]> = fields.array("position", Bound::Finite),
        /// Joint velocities \[rad/s\].
        velocity: Option<[f64; N]> = fields.array("velocity", Bound::Finite),
    }

    fn write(echo: Echo<State<N>>, to: &Address) -> Bytes {
        write_state(&echo, to)
    }
}
