//! `/pid_controller/set_gains`: the controller's gains.
//!
//! **Invariant:** gains that are not given do not change.

use bytes::Bytes;

use crate::math::pid::Gains;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

/// Sets the controller's gains, each at least 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetGains<const N: usize> {
    /// \[N m/rad\].
    pub kp: Option<[f64; N]>,
    /// \[N m/(rad s)\].
    pub ki: Option<[f64; N]>,
    /// \[N m s/rad\].
    pub kd: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> SetGains<N> {
    /// `gains` with these changes.
    #[must_use]
    pub fn applied_to(&self, gains: &Gains<N>) -> Gains<N> {
        Gains {
            kp: self.kp.unwrap_or(gains.kp),
            ki: self.ki.unwrap_or(gains.ki),
            kd: self.kd.unwrap_or(gains.kd),
        }
    }
}

impl<const N: usize> Ask for SetGains<N> {
    type Answer = Echo<Gains<N>>;
}

impl<const N: usize> FieldByField for SetGains<N> {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            kp: fields.array("kp", Bound::NonNegative),
            ki: fields.array("ki", Bound::NonNegative),
            kd: fields.array("kd", Bound::NonNegative),
            rejected: fields.rejections(),
        }
    }
}

impl<const N: usize> Answered for SetGains<N> {
    fn write(Echo { values, rejected }: Echo<Gains<N>>, to: &Address) -> Bytes {
        let values = object! {
            kp: values.kp.as_slice(),
            ki: values.ki.as_slice(),
            kd: values.kd.as_slice(),
        };
        to.response(&values, &rejected.status())
    }
}
