//! `/pid_controller/set_gains`: the controller's gains.
//!
//! **Invariant:** gains that are not given do not change.

use bytes::Bytes;

use crate::math::pid::Gains;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the controller's gains, each at least 0.
    pub struct SetGains<N> -> Echo<Gains<N>>, |fields| {
        /// \[N m/rad\].
        kp: Option<[f64; N]> = fields.array("kp", Bound::NonNegative),
        /// \[N m/(rad s)\].
        ki: Option<[f64; N]> = fields.array("ki", Bound::NonNegative),
        /// \[N m s/rad\].
        kd: Option<[f64; N]> = fields.array("kd", Bound::NonNegative),
    }

    fn write(Echo { values, rejected }: Echo<Gains<N>>, to: &Address) -> Bytes {
        let values = object! {
            kp: values.kp.as_slice(),
            ki: values.ki.as_slice(),
            kd: values.kd.as_slice(),
        };
        to.response(&values, &rejected.status())
    }
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
