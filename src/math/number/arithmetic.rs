//! Arithmetic as a method's steps need it: less than dynamics and control do, so that numbers of more digits can be
//! stepped too.
//!
//! **Invariant:** every number of the arm's formulas implements it.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Sums, products and quotients, of numbers and with constants.
pub trait Arithmetic:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// `value` as a number of the kind of `self`, in as many lanes.
    #[must_use]
    fn like(self, value: f64) -> Self;
}

impl Arithmetic for f64 {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        value
    }
}
