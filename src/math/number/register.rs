//! A register full of numbers, as wide as the machine's are.
//!
//! **Invariant:** as in [`super`]: nothing is fused, so that a lane has the bits of one number.

use std::ops::{Add, Div, Mul, Neg, Sub};

use fearless_simd::prelude::*;

use super::Number;

/// As many numbers as a register of `S` has lanes.
#[derive(Clone, Copy)]
pub(in crate::math) struct Register<S: Simd>(S::f64s);

impl<S: Simd> Register<S> {
    /// How many lanes there are.
    pub(in crate::math) const LANES: usize = S::f64s::LEN;

    /// `value` in all lanes.
    #[inline(always)]
    pub(in crate::math) fn splat(simd: S, value: f64) -> Self {
        Self(S::f64s::splat(simd, value))
    }

    /// Whether all lanes of all values are finite.
    #[inline(always)]
    pub(in crate::math) fn all_finite(some: &[Self], others: &[Self]) -> bool {
        let Some(first) = some.first() else {
            return true;
        };
        // Times 0 a finite number is 0, and any other is not a number.
        let mut sum = *first * 0.0;
        for value in some {
            sum = sum + *value * 0.0;
        }
        for value in others {
            sum = sum + *value * 0.0;
        }
        sum.0.simd_eq(0.0).all_true()
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd> $operator for Register<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Simd> Neg for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<S: Simd> Add<f64> for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: f64) -> Self {
        self + self.like(other)
    }
}

impl<S: Simd> Mul<f64> for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * self.like(other)
    }
}

/// Several arms.
impl<S: Simd> Number for Register<S> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self::splat(self.0.token(), value)
    }

    #[inline(always)]
    fn clamped(self, limit: f64) -> Self {
        let (least, most) = (self.like(-limit).0, self.like(limit).0);
        let low = self.0.simd_lt(least).select(least, self.0);
        Self(low.simd_gt(most).select(most, low))
    }

    #[inline(always)]
    fn all_within(values: &[Self], limit: f64) -> bool {
        let [first, ..] = values else {
            return true;
        };
        let mut within = first.0.abs().simd_le(limit);
        for value in values {
            within &= value.0.abs().simd_le(limit);
        }
        within.all_true()
    }

    #[inline(always)]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self) {
        let simd = self.0.token();
        let (one, two) = (S::u64s::splat(simd, 1), S::u64s::splat(simd, 2));
        let quadrant: S::u64s = self.0.bitcast();
        let odd = (quadrant & one).simd_eq(one);
        let sine_is_negative = (quadrant & two).simd_eq(two);
        let cosine_is_negative = ((quadrant + one) & two).simd_eq(two);
        let sin = odd.select(cosine.0, sine.0);
        let cos = odd.select(sine.0, cosine.0);
        (
            Self(sine_is_negative.select(-sin, sin)),
            Self(cosine_is_negative.select(-cos, cos)),
        )
    }

    #[inline(always)]
    fn lanes(&self) -> &[f64] {
        self.0.as_slice()
    }

    #[inline(always)]
    fn lanes_mut(&mut self) -> &mut [f64] {
        self.0.as_mut_slice()
    }
}
