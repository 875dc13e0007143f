//! The last predicted limits of the arm, and which loops they apply to.
//!
//! **Invariant:** a limit is stored together with its loop.

use std::time::Duration;

use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

/// The last predicted limit.
#[derive(Default)]
pub(crate) struct LimitWatch<const N: usize> {
    /// The loop of the last request, and its time.
    pub(crate) asked: Option<(ControlLoop<N>, Duration)>,
    /// Whether the answer is still pending.
    pub(crate) waiting: bool,
    /// The latest answer and its loop.
    pub(crate) known: Option<(ControlLoop<N>, ClockLimits)>,
    /// The last published warnings: whether a timestep or a period was too long, and whether a goal waited for
    /// the controller.
    pub(crate) warned: (bool, bool),
}

/// Whether two loops have the same limit. It depends on everything except the timestep.
pub(crate) fn share_limit<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.setpoint == other.setpoint && resemble(one, other)
}

/// Whether two loops differ at most in setpoint and timestep.
pub(crate) fn resemble<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.arm == other.arm
        && one.gains == other.gains
        && one.method == other.method
        && one.period == other.period
}
