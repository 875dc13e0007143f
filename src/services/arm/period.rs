//! `/pid_controller/set_period`: the control period.
//!
//! **Invariant:** setting the present values does not change the arm, not even the step in its period.

use bytes::Bytes;

use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

/// Sets the time between two runs of the control law.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetPeriod {
    /// That time \[s\], not negative; 0 for every step.
    pub period: Option<f64>,
    /// Whether an effort is applied one period after its state was read.
    pub delay: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// The present control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodInForce {
    /// The requested time, and the delay.
    pub period: ControlPeriod,
    /// The effective period, a whole number of timesteps \[s\].
    pub effective: f64,
}

impl Ask for SetPeriod {
    type Answer = Echo<PeriodInForce>;
}

impl FieldByField for SetPeriod {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            period: fields.number("period", Bound::NonNegative),
            delay: fields.boolean("delay"),
            rejected: fields.rejections(),
        }
    }
}

impl Answered for SetPeriod {
    fn write(Echo { values, rejected }: Echo<PeriodInForce>, to: &Address) -> Bytes {
        let values = object! {
            period: values.period.period,
            effective_period: values.effective,
            delay: values.period.delay,
        };
        to.response(&values, &rejected.status())
    }
}
