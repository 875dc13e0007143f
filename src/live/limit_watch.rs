//! The arm's memory of its largest stable timestep and control period, and which loops share one.
//!
//! **Invariant:** a limit is kept together with the loop that it is about.

use std::time::Duration;

use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

/// The arm's memory of its limit.
#[derive(Default)]
pub(crate) struct LimitWatch<const N: usize> {
    /// The loop that was last asked about, and when.
    pub(crate) asked: Option<(ControlLoop<N>, Duration)>,
    /// The answer is on its way.
    pub(crate) waiting: bool,
    /// The latest answer, and the loop that it is about.
    pub(crate) known: Option<(ControlLoop<N>, ClockLimits)>,
    /// Whether a timestep or a period was too long, and whether the controller held a goal up, when that was last
    /// published.
    pub(crate) warned: (bool, bool),
}

/// Whether two loops have one limit: it depends on everything but the timestep.
pub(crate) fn share_limit<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.setpoint == other.setpoint && resemble(one, other)
}

/// Whether two loops differ in setpoint and timestep at most.
pub(crate) fn resemble<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.arm == other.arm
        && one.gains == other.gains
        && one.method == other.method
        && one.period == other.period
}
