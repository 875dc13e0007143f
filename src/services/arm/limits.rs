//! `/pid_controller/set_limits`: the limits of the motors, and the anti-windup of the controller.
//!
//! **Invariant:** setting the present values does not change the arm.

use bytes::Bytes;

use crate::math::limits::{AntiWindup, Limits};
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the largest efforts that the motors apply, and what the integral does meanwhile.
    pub struct SetLimits<N> -> Echo<Limits<N>>, |fields| {
        /// The largest effort of each joint \[N m\], at least 0; 0 is a joint without a motor. `Some(None)` ends the
        /// limit.
        effort: Option<Option<[f64; N]>> = fields.array_or_null("effort", Bound::NonNegative),
        /// The form of anti-windup.
        anti_windup: Option<AntiWindup> = fields.choice("anti_windup", &AntiWindup::ALL, AntiWindup::name),
        /// The tracking time of the back calculation \[s\], greater than 0.
        tracking_time: Option<f64> = fields.number("tracking_time", Bound::Positive),
    }

    fn write(Echo { values, rejected }: Echo<Limits<N>>, to: &Address) -> Bytes {
        let values = object! {
            effort: values.effort.as_ref().map(<[f64; N]>::as_slice),
            anti_windup: values.anti_windup.name(),
            tracking_time: values.tracking_time,
        };
        to.response(&values, &rejected.status())
    }
}

impl<const N: usize> SetLimits<N> {
    /// `limits` with these changes.
    #[must_use]
    pub fn applied_to(&self, limits: &Limits<N>) -> Limits<N> {
        Limits {
            effort: self.effort.unwrap_or(limits.effort),
            anti_windup: self.anti_windup.unwrap_or(limits.anti_windup),
            tracking_time: self.tracking_time.unwrap_or(limits.tracking_time),
        }
    }
}
