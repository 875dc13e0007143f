//! Two registers full of numbers, each as wide as the machine's are.
//!
//! Every operation is done in both, one behind the other: the processor, which looks some hundred operations ahead,
//! then always has one to do while the other waits for its result.
//!
//! **Invariant:** as in [`super`]: a lane has the bits of one number.

#![allow(
    clippy::indexing_slicing,
    reason = "lanes run over those of the two registers"
)]

use std::ops::{Add, Div, Mul, Neg, Sub};

use fearless_simd::prelude::*;

use super::{Arithmetic, Number};

/// As many numbers as two registers of `S` have lanes.
#[derive(Clone, Copy)]
pub(in crate::math) struct RegisterPair<S: Simd>([S::f64s; 2]);

impl<S: Simd> RegisterPair<S> {
    /// How many lanes one of the two has.
    pub(in crate::math) const WIDTH: usize = S::f64s::LEN;

    /// `value` in all lanes.
    #[inline(always)]
    pub(in crate::math) fn splat(simd: S, value: f64) -> Self {
        Self([S::f64s::splat(simd, value); 2])
    }

    /// The first numbers of `column`, one in each lane; there are enough.
    #[inline(always)]
    pub(in crate::math) fn load(simd: S, column: &[f64]) -> Self {
        let (first, second) = (&column[..Self::WIDTH], &column[Self::WIDTH..Self::LANES]);
        Self([
            S::f64s::from_slice(simd, first),
            S::f64s::from_slice(simd, second),
        ])
    }

    /// Puts the number of each lane into `column`, which has room for them.
    #[inline(always)]
    pub(in crate::math) fn store(self, column: &mut [f64]) {
        self.0[0].store_slice(&mut column[..Self::WIDTH]);
        self.0[1].store_slice(&mut column[Self::WIDTH..Self::LANES]);
    }

    /// Whether all lanes of all values are finite.
    #[inline(always)]
    pub(in crate::math) fn all_finite(some: &[Self], others: &[Self]) -> bool {
        let Some(first) = some.first() else {
            return true;
        };
        // Times 0 a finite number is 0, and any other is not a number.
        let mut sum = first.0[0] * 0.0;
        for value in some {
            sum = value.0[0].mul_add(0.0, sum);
            sum = value.0[1].mul_add(0.0, sum);
        }
        for value in others {
            sum = value.0[0].mul_add(0.0, sum);
            sum = value.0[1].mul_add(0.0, sum);
        }
        sum.simd_eq(0.0).all_true()
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd> $operator for RegisterPair<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self([self.0[0].$method(other.0[0]), self.0[1].$method(other.0[1])])
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Simd> Neg for RegisterPair<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1]])
    }
}

impl<S: Simd> Add<f64> for RegisterPair<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: f64) -> Self {
        self + self.like(other)
    }
}

impl<S: Simd> Mul<f64> for RegisterPair<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * self.like(other)
    }
}

impl<S: Simd> Arithmetic for RegisterPair<S> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self::splat(self.0[0].token(), value)
    }
}

/// Several arms.
impl<S: Simd> Number for RegisterPair<S> {
    const LANES: usize = 2 * S::f64s::LEN;

    #[inline(always)]
    fn less_exact(self, factor: Self, other: f64) -> Self {
        let minus = S::f64s::splat(self.0[0].token(), -other);
        Self([
            factor.0[0].mul_add(minus, self.0[0]),
            factor.0[1].mul_add(minus, self.0[1]),
        ])
    }

    #[inline(always)]
    fn clamped(self, limit: f64) -> Self {
        Self([
            clamped::<S>(self.0[0], limit),
            clamped::<S>(self.0[1], limit),
        ])
    }

    #[inline(always)]
    fn all_within(values: &[Self], limit: f64) -> bool {
        let [first, ..] = values else {
            return true;
        };
        let mut within = first.0[0].abs().simd_le(limit);
        for value in values {
            within &= value.0[0].abs().simd_le(limit);
            within &= value.0[1].abs().simd_le(limit);
        }
        within.all_true()
    }

    #[inline(always)]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self) {
        let first = turned::<S>(self.0[0], sine.0[0], cosine.0[0]);
        let second = turned::<S>(self.0[1], sine.0[1], cosine.0[1]);
        (Self([first.0, second.0]), Self([first.1, second.1]))
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane / Self::WIDTH].as_slice()[lane % Self::WIDTH]
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane / Self::WIDTH].as_mut_slice()[lane % Self::WIDTH] = value;
    }
}

#[inline(always)]
fn clamped<S: Simd>(value: S::f64s, limit: f64) -> S::f64s {
    let simd = value.token();
    let (least, most) = (S::f64s::splat(simd, -limit), S::f64s::splat(simd, limit));
    let low = value.simd_lt(least).select(least, value);
    low.simd_gt(most).select(most, low)
}

#[inline(always)]
fn turned<S: Simd>(shifted: S::f64s, sine: S::f64s, cosine: S::f64s) -> (S::f64s, S::f64s) {
    let simd = shifted.token();
    let (one, two) = (S::u64s::splat(simd, 1), S::u64s::splat(simd, 2));
    let quadrant: S::u64s = shifted.bitcast();
    let odd = (quadrant & one).simd_eq(one);
    let sin: S::u64s = odd.select(cosine, sine).bitcast();
    let cos: S::u64s = odd.select(sine, cosine).bitcast();
    let negative_sine = (quadrant & two) << 62;
    let negative_cosine = ((quadrant + one) & two) << 62;
    (
        (sin ^ negative_sine).bitcast(),
        (cos ^ negative_cosine).bitcast(),
    )
}
