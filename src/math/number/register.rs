//! One or two SIMD registers of numbers.
//!
//! Every operation is done in both registers, one after the other. While one waits for a result, the
//! processor can execute the other, because it looks some hundred operations ahead.
//!
//! **Invariant:** a lane is bit-identical to a single number, as in [`super`].

#![allow(
    clippy::indexing_slicing,
    reason = "registers run over 0..K of arrays that have K elements, lanes over those of all of them"
)]

use std::ops::{Add, Div, Mul, Neg, Sub};

#[cfg(target_arch = "x86_64")]
use fearless_simd::f64x2;
use fearless_simd::prelude::*;

use super::{Arithmetic, Number};

/// `$do` for register 0 and, if there are two, register 1. This is not a loop, because the compiler would have to
/// unroll it for every operation.
macro_rules! each_register {
    ($i:ident => $do:block) => {{
        {
            let $i = 0;
            $do
        }
        if Self::TWO {
            let $i = 1;
            $do
        }
    }};
}

/// The numbers in all lanes of `K` registers of `S`; `K` is 1 or 2.
#[derive(Clone, Copy)]
pub(in crate::math) struct Wide<S: Simd, const K: usize>([S::f64s; K]);

impl<S: Simd, const K: usize> Wide<S, K> {
    /// Whether there is a second register.
    const TWO: bool = K == 2;

    /// The number of lanes of one register.
    pub(in crate::math) const WIDTH: usize = S::f64s::LEN;

    /// `value` in all lanes.
    #[inline(always)]
    pub(in crate::math) fn splat(simd: S, value: f64) -> Self {
        Self([S::f64s::splat(simd, value); K])
    }

    /// The token that proves that the machine has such registers.
    #[inline(always)]
    pub(in crate::math) fn token(self) -> S {
        self.0[0].token()
    }

    /// Loads the first numbers of `column`, one into each lane. `column` must have enough.
    #[inline(always)]
    pub(in crate::math) fn load(simd: S, column: &[f64]) -> Self {
        let mut loaded = [S::f64s::splat(simd, 0.0); K];
        each_register!(i => {
            loaded[i] = S::f64s::from_slice(simd, &column[i * Self::WIDTH..][..Self::WIDTH]);
        });
        Self(loaded)
    }

    /// Stores the number of each lane in `column`, which must be long enough.
    #[inline(always)]
    pub(in crate::math) fn store(self, column: &mut [f64]) {
        each_register!(i => {
            self.0[i].store_slice(&mut column[i * Self::WIDTH..][..Self::WIDTH]);
        });
    }

    /// Whether all lanes of all values are finite.
    #[inline(always)]
    pub(in crate::math) fn all_finite(some: &[Self], others: &[Self]) -> bool {
        let Some(first) = some.first() else {
            return true;
        };
        // A finite number times 0 is 0; any other gives NaN.
        let mut sum = first.0[0] * 0.0;
        for value in some {
            each_register!(i => {
                sum = value.0[i].mul_add(0.0, sum);
            });
        }
        for value in others {
            each_register!(i => {
                sum = value.0[i].mul_add(0.0, sum);
            });
        }
        sum.simd_eq(0.0).all_true()
    }
}

/// Runs a closure with the machine's registers enabled, in a separate function that is compiled once for all callers.
#[inline(never)]
pub(in crate::math) fn apart<S: Simd, R>(simd: S, work: impl FnOnce() -> R) -> R {
    simd.vectorize(work)
}

/// A register of two lanes, as on plain `x86-64`.
#[cfg(target_arch = "x86_64")]
impl<S: Simd<f64s = f64x2<S>>> Wide<S, 1> {
    /// A number in each lane.
    #[inline(always)]
    pub(in crate::math) fn two(simd: S, lower: f64, upper: f64) -> Self {
        Self([f64x2::simd_from(simd, [lower, upper])])
    }

    /// The number of the upper lane, in both lanes.
    #[inline(always)]
    pub(in crate::math) fn upper(self) -> Self {
        let [register] = self.0;
        Self([register.zip_high(register)])
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd, const K: usize> $operator for Wide<S, K> {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                each_register!(i => {
                    self.0[i] = self.0[i].$method(other.0[i]);
                });
                self
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Simd, const K: usize> Neg for Wide<S, K> {
    type Output = Self;

    #[inline(always)]
    fn neg(mut self) -> Self {
        each_register!(i => {
            self.0[i] = -self.0[i];
        });
        self
    }
}

impl<S: Simd, const K: usize> Add<f64> for Wide<S, K> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: f64) -> Self {
        self + self.like(other)
    }
}

impl<S: Simd, const K: usize> Mul<f64> for Wide<S, K> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * self.like(other)
    }
}

impl<S: Simd, const K: usize> Arithmetic for Wide<S, K> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self::splat(self.token(), value)
    }
}

/// Several arms.
impl<S: Simd, const K: usize> Number for Wide<S, K> {
    const LANES: usize = K * S::f64s::LEN;

    #[inline(always)]
    fn sub_exact_product(mut self, factor: Self, other: f64) -> Self {
        let minus = S::f64s::splat(self.token(), -other);
        each_register!(i => {
            self.0[i] = factor.0[i].mul_add(minus, self.0[i]);
        });
        self
    }

    #[inline(always)]
    fn clamped(mut self, limit: f64) -> Self {
        each_register!(i => {
            self.0[i] = clamped::<S>(self.0[i], limit);
        });
        self
    }

    #[inline(always)]
    fn all_within(values: &[Self], limit: f64) -> bool {
        let [first, rest @ ..] = values else {
            return true;
        };
        // The sum of all squares is compared: if it is within the bound, so is every square.
        let mut sums = first.0;
        each_register!(i => {
            sums[i] = sums[i] * sums[i];
            for value in rest {
                sums[i] = value.0[i].mul_add(value.0[i], sums[i]);
            }
        });
        let mut within = sums[0].simd_le(limit * limit);
        if Self::TWO {
            within &= sums[1].simd_le(limit * limit);
        }
        within.all_true()
    }

    #[inline(always)]
    fn turned(self, mut sine: Self, mut cosine: Self) -> (Self, Self) {
        each_register!(i => {
            (sine.0[i], cosine.0[i]) = turned::<S>(self.0[i], sine.0[i], cosine.0[i]);
        });
        (sine, cosine)
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
    let one = S::u64s::splat(simd, 1);
    let sign = S::u64s::splat(simd, 1 << 63);
    let quadrant: S::u64s = shifted.bitcast();
    let (sin, cos): (S::u64s, S::u64s);
    if S::f64s::LEN == 2 {
        // Plain `x86-64` has no comparison of integers of this length.
        let odd = S::u64s::splat(simd, 0) - (quadrant & one);
        let (sine, cosine): (S::u64s, S::u64s) = (sine.bitcast(), cosine.bitcast());
        let exchange = (sine ^ cosine) & odd;
        (sin, cos) = (sine ^ exchange, cosine ^ exchange);
    } else {
        let odd = (quadrant & one).simd_eq(one);
        sin = odd.select(cosine, sine).bitcast();
        cos = odd.select(sine, cosine).bitcast();
    }
    let half = quadrant << 62;
    let negative_sine = half & sign;
    let negative_cosine = (half + S::u64s::splat(simd, 1 << 62)) & sign;
    (
        (sin ^ negative_sine).bitcast(),
        (cos ^ negative_cosine).bitcast(),
    )
}
