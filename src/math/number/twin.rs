//! x
#![allow(clippy::indexing_slicing, reason = "x")]
use std::ops::{Add, Div, Mul, Neg, Sub};
use fearless_simd::prelude::*;
use fearless_simd::{f64x2, u64x2};
use super::{Arithmetic, Number};

#[derive(Clone, Copy)]
pub(in crate::math) struct Twin<S: Simd>(f64x2<S>);

impl<S: Simd> Twin<S> {
    #[inline(always)]
    pub(in crate::math) fn one(simd: S, value: f64) -> Self {
        Self(f64x2::simd_from(simd, [value, 0.0]))
    }
    #[inline(always)]
    pub(in crate::math) fn two(simd: S, value: f64, other: f64) -> Self {
        Self(f64x2::simd_from(simd, [value, other]))
    }
    #[inline(always)]
    pub(in crate::math) fn upper(self) -> Self {
        Self(self.0.zip_high(self.0))
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd> $operator for Twin<S> {
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

impl<S: Simd> Neg for Twin<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<S: Simd> Add<f64> for Twin<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self(self.0 + other)
    }
}

impl<S: Simd> Mul<f64> for Twin<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        Self(self.0 * other)
    }
}

impl<S: Simd> Arithmetic for Twin<S> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self(f64x2::splat(self.0.token(), value))
    }
}


impl<S: Simd> Number for Twin<S> {
    const LANES: usize = 2;
    #[inline(always)]
    fn less_exact(self, factor: Self, other: f64) -> Self {
        self - factor * other
    }
    #[inline(always)]
    fn clamped(self, _limit: f64) -> Self {
        self
    }
    #[inline(always)]
    fn all_within(values: &[Self], limit: f64) -> bool {
        let [first, ..] = values else { return true; };
        let mut within = first.0.abs().simd_le(limit);
        for value in values { within &= value.0.abs().simd_le(limit); }
        within.all_true()
    }
    #[inline(always)]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self) {
        let simd = self.0.token();
        let quadrant: u64x2<S> = self.0.bitcast();
        let (s, c): (u64x2<S>, u64x2<S>) = (sine.0.bitcast(), cosine.0.bitcast());
        let odd = u64x2::splat(simd, 0) - (quadrant & u64x2::splat(simd, 1));
        let exchange = (s ^ c) & odd;
        let sign = u64x2::splat(simd, 1 << 63);
        let turned = quadrant << 62;
        let ns = turned & sign;
        let nc = (turned + u64x2::splat(simd, 1 << 62)) & sign;
        (Self(((s ^ ns) ^ exchange).bitcast()), Self(((c ^ nc) ^ exchange).bitcast()))
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0.as_slice()[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0.as_mut_slice()[lane] = value;
    }
}
