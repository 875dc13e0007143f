//! `/arm_sim/set_params`: gravity, masses and lengths.
//!
//! **Invariant:** the arm is replaced as a whole, or not at all.

use bytes::Bytes;

use crate::math::arm::{Arm, ArmError};
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the arm's parameters.
    pub struct SetParams<N> -> Echo<Arm<N>>, |fields| {
        /// \[m/s²\], at least 0.
        gravity: Option<f64> = fields.number("gravity", Bound::NonNegative),
        /// \[kg\], greater than 0.
        masses: Option<[f64; N]> = fields.array("masses", Bound::Positive),
        /// \[m\], greater than 0.
        lengths: Option<[f64; N]> = fields.array("lengths", Bound::Positive),
    }

    fn write(Echo { values, rejected }: Echo<Arm<N>>, to: &Address) -> Bytes {
        let values = object! {
            gravity: values.gravity(),
            masses: values.masses().as_slice(),
            lengths: values.lengths().as_slice(),
        };
        to.response(&values, &rejected.status())
    }
}

impl<const N: usize> SetParams<N> {
    /// `arm` with these changes.
    ///
    /// # Errors
    /// If such an arm is not valid.
    pub fn applied_to(&self, arm: &Arm<N>) -> Result<Arm<N>, ArmError> {
        Arm::new(
            self.lengths.unwrap_or(*arm.lengths()),
            self.masses.unwrap_or(*arm.masses()),
            self.gravity.unwrap_or(arm.gravity()),
        )?
        .with_friction(*arm.viscous())
    }
}
