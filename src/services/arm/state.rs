//! `/arm_sim/set_state`: puts the arm into another state.
//!
//! **Invariant:** clock, setpoint, integral, gains and an active goal do not change.

use bytes::Bytes;

use super::reset::write_state;
use crate::math::arm::State;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

/// Sets positions and velocities, running or paused, and ends a divergence.
#[derive(Debug, Clone, PartialEq)]
pub struct SetState<const N: usize> {
    /// Joint positions \[rad\].
    pub position: Option<[f64; N]>,
    /// Joint velocities \[rad/s\].
    pub velocity: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for SetState<N> {
    type Answer = Echo<State<N>>;
}

impl<const N: usize> FieldByField for SetState<N> {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            position: fields.array("position", Bound::Finite),
            velocity: fields.array("velocity", Bound::Finite),
            rejected: fields.rejections(),
        }
    }
}

impl<const N: usize> Answered for SetState<N> {
    fn write(echo: Echo<State<N>>, to: &Address) -> Bytes {
        write_state(&echo, to)
    }
}
