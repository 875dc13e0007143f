//! Complex numbers, for eigenvalues.
//!
//! **Invariant:** infinities and NaN are passed on.

use crate::math::elementary::hypot;

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    pub(super) const fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    /// Modulus, without intermediate overflow.
    #[must_use]
    pub fn modulus(self) -> f64 {
        hypot(self.re, self.im)
    }
}
