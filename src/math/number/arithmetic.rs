//! Arithmetic as a method's steps need it: less than dynamics and control do, so that numbers of more digits can be
//! stepped too.
//!
//! **Invariant:** for a number of the arm's formulas it is that number's own.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Number;

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
    /// `value` as a number of the kind of `self`.
    #[must_use]
    fn like(self, value: f64) -> Self;
}

impl<T: Number> Arithmetic for T {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Number::like(self, value)
    }
}
