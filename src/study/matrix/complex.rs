//! Complex numbers, as far as eigenvalues need them.
//!
//! **Invariant:** plain arithmetic; infinities and NaN are passed on.

use crate::math::elementary::hypot;
use std::ops::{Add, Mul, Sub};

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    pub(super) const ZERO: Self = Self { re: 0.0, im: 0.0 };

    #[inline]
    pub(super) const fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    /// Modulus, without overflow on the way.
    #[must_use]
    pub fn modulus(self) -> f64 {
        hypot(self.re, self.im)
    }

    #[inline]
    pub(super) fn conjugate(self) -> Self {
        Self {
            re: self.re,
            im: -self.im,
        }
    }

    #[inline]
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self {
            re: self.re * factor,
            im: self.im * factor,
        }
    }

    /// Principal square root.
    pub(super) fn sqrt(self) -> Self {
        let modulus = self.modulus();
        // The larger of the two parts is computed first, so that the other follows without cancellation.
        let part = (0.5 * (modulus + self.re.abs())).sqrt();
        if part == 0.0 {
            return Self::ZERO;
        }
        let other = 0.5 * self.im / part;
        if self.re >= 0.0 {
            Self {
                re: part,
                im: other,
            }
        } else {
            Self {
                re: other.abs(),
                im: part.copysign(self.im),
            }
        }
    }
}

impl Add for Complex {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl Sub for Complex {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}

impl Mul for Complex {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}
