//! `/arm_sim/set_friction`: viscous friction of the joints.
//!
//! **Invariant:** lengths, masses and gravity do not change.

use bytes::Bytes;

use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the friction of each joint.
    pub struct SetFriction<N> -> Echo<[f64; N]>, |fields| {
        /// \[N m s/rad\], at least 0.
        viscous: Option<[f64; N]> = fields.array("viscous", Bound::NonNegative),
    }

    fn write(Echo { values, rejected }: Echo<[f64; N]>, to: &Address) -> Bytes {
        let values = object! {
            viscous: values.as_slice(),
        };
        to.response(&values, &rejected.status())
    }
}
