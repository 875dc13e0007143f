//! `/arm_sim/set_params`: gravity, masses and lengths.
//!
//! **Invariant:** the arm is replaced as a whole, or not at all.

use bytes::Bytes;

use crate::math::arm::{Arm, ArmError};
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Answered, Ask, Echo, FieldByField};

/// Sets the arm's parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetParams<const N: usize> {
    /// \[m/s²\], at least 0.
    pub gravity: Option<f64>,
    /// \[kg\], greater than 0.
    pub masses: Option<[f64; N]>,
    /// \[m\], greater than 0.
    pub lengths: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
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
        )
    }
}

impl<const N: usize> Ask for SetParams<N> {
    type Answer = Echo<Arm<N>>;
}

impl<const N: usize> FieldByField for SetParams<N> {
    fn from_fields(fields: &mut Fields<'_>) -> Self {
        Self {
            gravity: fields.number("gravity", Bound::NonNegative),
            masses: fields.array("masses", Bound::Positive),
            lengths: fields.array("lengths", Bound::Positive),
            rejected: fields.rejections(),
        }
    }
}

impl<const N: usize> Answered for SetParams<N> {
    fn write(Echo { values, rejected }: Echo<Arm<N>>, to: &Address) -> Bytes {
        let values = object! {
            gravity: values.gravity(),
            masses: values.masses().as_slice(),
            lengths: values.lengths().as_slice(),
        };
        to.response(&values, &rejected.status())
    }
}
