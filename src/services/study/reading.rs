//! Readers for requests to `study`, as a whole.
//!
//! **Invariant:** one invalid field rejects the whole request, and each invalid field is named.

use crate::math::arm::{Arm, ArmError};
use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::arm::SetParams;

/// The request, unless a field was rejected.
pub(super) fn taken<A>(ask: A, fields: Fields<'_>) -> Result<A, Rejections> {
    if fields.accepted() {
        Ok(ask)
    } else {
        Err(fields.finish())
    }
}

/// The present control period, with another length \[s\] if one is given.
pub(super) fn with_period(present: ControlPeriod, period: Option<f64>) -> ControlPeriod {
    ControlPeriod {
        period: period.unwrap_or(present.period),
        ..present
    }
}

/// The present arm, with the given parameters in place of its own.
pub(super) fn arm_of<const N: usize>(
    params: Option<&SetParams<N>>,
    present: Arm<N>,
) -> Result<Arm<N>, ArmError> {
    params.map_or(Ok(present), |params| params.applied_to(&present))
}
