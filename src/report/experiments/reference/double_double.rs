//! Arithmetic on unevaluated sums of two doubles: some 31 decimal digits, for references only.
//!
//! A number is `hi + lo` with `|lo| ≤ ulp(hi) / 2`. Sums and products of two doubles are made exact by Knuth's two-sum
//! and by Dekker's product. Doubles are split in halves, so that no fused multiply-add is needed and every machine
//! gives the same bits.
//!
//! Source: Dekker, *Numer. Math.* 18 (1971); Hida, Li and Bailey, *Library for double-double and quad-double
//! arithmetic* (2007).
//!
//! **Invariant:** shares nothing with the arm's own dynamics, and [`two_sum`] with its sums, so that a mistake is not
//! in both.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::math::arm::Arm;
use crate::math::integrator::two_sum;
use crate::math::number::Arithmetic;
use crate::study::taylor::{Precision, series};

/// A number of about 106 bits. Magnitudes beyond 1e300 are not meant to work: splitting overflows there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// π/2 in three doubles.
const HALF_PI: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    6.123_233_995_736_766e-17,
    -1.497_384_904_859_183_3e-33,
];

/// Terms of the Taylor series of sine and cosine on `|x| ≤ π/4`: `(π/4)^34 / 34! < 1e-41`, below the last of 106 bits.
const TERMS: u32 = 34;

impl DoubleDouble {
    /// Zero.
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// The nearest double.
    pub const fn to_f64(self) -> f64 {
        self.hi
    }

    /// Magnitude.
    pub fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }

    /// Held between `-bound` and `bound`.
    pub fn clamp(self, bound: f64) -> Self {
        if self.hi > bound {
            Self::from(bound)
        } else if self.hi < -bound {
            Self::from(-bound)
        } else {
            self
        }
    }

    /// Sine and cosine of this angle \[rad\], which is at most some 1e6.
    pub fn sin_cos(self) -> (Self, Self) {
        let turns = (self.hi * std::f64::consts::FRAC_2_PI).round();
        let reduced = HALF_PI.iter().fold(self, |rest, part| {
            rest - Self::from(turns) * Self::from(*part)
        });
        let square = reduced * reduced;
        let (mut sin, mut cos) = (reduced, Self::from(1.0));
        let (mut odd, mut even) = (reduced, Self::from(1.0));
        for n in (2..=TERMS).step_by(2) {
            let n = f64::from(n);
            even = -even * square / Self::from((n - 1.0) * n);
            odd = -odd * square / Self::from(n * (n + 1.0));
            cos = cos + even;
            sin = sin + odd;
        }
        // Whole numbers, so the comparison is exact.
        match turns.rem_euclid(4.0) {
            quarter if quarter < 0.5 => (sin, cos),
            quarter if quarter < 1.5 => (cos, -sin),
            quarter if quarter < 2.5 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

impl From<f64> for DoubleDouble {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let (hi, carry) = two_sum(self.hi, other.hi);
        let (lo, rest) = two_sum(self.lo, other.lo);
        let (hi, carry) = fast_two_sum(hi, carry + lo);
        let (hi, lo) = fast_two_sum(hi, carry + rest);
        Self { hi, lo }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for DoubleDouble {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let (hi, lo) = two_product(self.hi, other.hi);
        let (hi, lo) = fast_two_sum(hi, lo + (self.hi * other.lo + self.lo * other.hi));
        Self { hi, lo }
    }
}

impl Div for DoubleDouble {
    type Output = Self;

    /// Long division: three quotient digits of 53 bits each.
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self - other * Self::from(first);
        let second = rest.hi / other.hi;
        let rest = rest - other * Self::from(second);
        let third = rest.hi / other.hi;
        let (hi, lo) = fast_two_sum(first, second);
        Self { hi, lo } + Self::from(third)
    }
}

impl Add<f64> for DoubleDouble {
    type Output = Self;

    #[inline]
    fn add(self, other: f64) -> Self {
        self + Self::from(other)
    }
}

impl Mul<f64> for DoubleDouble {
    type Output = Self;

    #[inline]
    fn mul(self, other: f64) -> Self {
        self * Self::from(other)
    }
}

impl Arithmetic for DoubleDouble {
    #[inline]
    fn like(self, value: f64) -> Self {
        Self::from(value)
    }
}

impl Precision for DoubleDouble {
    const LEAST_TOLERANCE: f64 = 1e-32;

    fn magnitude(self) -> f64 {
        self.hi.abs()
    }

    fn plus_carried(self, _: Self, change: Self) -> (Self, Self) {
        (self + change, Self::ZERO)
    }

    fn directions<const N: usize>(angles: &[Self; N]) -> ([Self; N], [Self; N]) {
        let both = angles.map(Self::sin_cos);
        (both.map(|one| one.0), both.map(|one| one.1))
    }

    fn acceleration<const N: usize>(
        arm: &Arm<N>,
        position: &[Self; N],
        velocity: &[Self; N],
        effort: &[Self; N],
    ) -> [Self; N] {
        series::acceleration(arm, &Self::directions(position), velocity, effort)
    }
}

/// Does what [`two_sum`] does, where `|a| ≥ |b|` or `a` is 0.
#[inline]
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

#[inline]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let (a_hi, a_lo) = split(a);
    let (b_hi, b_lo) = split(b);
    let rest = ((a_hi * b_hi - product) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo;
    (product, rest)
}

/// Two halves of at most 26 bits each, whose products with other halves are exact.
#[inline]
fn split(a: f64) -> (f64, f64) {
    let big = 134_217_729.0 * a;
    let hi = big - (big - a);
    (hi, a - hi)
}
