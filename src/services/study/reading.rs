//! How questions to `study` are read: as a whole.
//!
//! **Invariant:** one bad field refuses the whole question, and each bad field is named.

use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Fields, Rejections};

/// The question, unless a field of it was rejected.
pub(super) fn taken<A>(ask: A, fields: Fields<'_>) -> Result<A, Rejections> {
    if fields.accepted() {
        Ok(ask)
    } else {
        Err(fields.finish())
    }
}

/// The control period in force, with another length \[s\] where that is given.
pub(super) fn with_period(present: ControlPeriod, period: Option<f64>) -> ControlPeriod {
    ControlPeriod {
        period: period.unwrap_or(present.period),
        ..present
    }
}
