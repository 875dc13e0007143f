//! The arithmetic of a method's steps. It has fewer operations than dynamics and control need, so numbers with more
//! digits can implement it too.
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
    /// `value` as a number of the type of `self`, in every lane.
    #[must_use]
    fn like(self, value: f64) -> Self;
}

impl Arithmetic for f64 {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        value
    }
}
