//! `/pid_controller/set_period`: the control period.
//!
//! `delay` is an older name of the delay of `/pid_controller/set_sensors`: `false` is 0 periods and `true` is 1. The answer is
//! `true` at any delay.
//!
//! **Invariant:** setting the present values does not change the arm, not even the step in its period, while the delay is
//! at most 1.

use bytes::Bytes;

use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the time between two runs of the control law.
    pub struct SetPeriod -> Echo<PeriodInForce>, |fields| {
        /// That time \[s\], not negative; 0 for every step.
        period: Option<f64> = fields.number("period", Bound::NonNegative),
        /// Whether an effort is applied one period after its state was read, or none.
        delay: Option<bool> = fields.boolean("delay"),
    }

    fn write(Echo { values, rejected }: Echo<PeriodInForce>, to: &Address) -> Bytes {
        let values = object! {
            period: values.period.period,
            effective_period: values.effective,
            delay: values.period.delay > 0,
        };
        to.response(&values, &rejected.status())
    }
}

/// The present control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodInForce {
    /// The requested time, and the delay.
    pub period: ControlPeriod,
    /// The effective period, a whole number of timesteps \[s\].
    pub effective: f64,
}
