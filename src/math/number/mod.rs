//! The number type of the arm's formulas: a double for one arm, or a few registers with one lane for each of several
//! arms.
//!
//! Dynamics, methods and control law are written once, over [`Number`], for any number of lanes. Every operation
//! acts on all lanes. Two operations depend on the value in each lane: the bound of an integral and the quadrant of
//! an angle. They select and do not branch.
//!
//! **Invariant:** every operation rounds once, to the nearest, as in IEEE 754. Operations are fused only where the
//! result is the same. So a lane is bit-identical to the arm stepped alone, on every machine and for every
//! register width.

mod arithmetic;
#[cfg(feature = "batch")]
mod register;
#[cfg(feature = "batch")]
mod registers;

pub use arithmetic::Arithmetic;
#[cfg(feature = "batch")]
pub(super) use register::{Wide, apart};
#[cfg(feature = "batch")]
pub use registers::Registers;

/// An array with an entry for each `$i`. Its length is that of the destination; `$any` is any number of the type.
///
/// A loop replaces [`std::array::from_fn`], because the compiler may compile its closures as separate functions. The
/// wide registers are not enabled there, and every operation would be a call.
macro_rules! entries {
    ($any:expr, $i:ident => $entry:expr) => {{
        let mut entries = [$any; N];
        for $i in 0..N {
            entries[$i] = $entry;
        }
        entries
    }};
}
pub(super) use entries;

/// A number, or one number per lane of a few registers. Constants are the same in all lanes.
pub trait Number: Arithmetic {
    /// The number of lanes.
    const LANES: usize;

    /// `self - factor * other`. The product must be exact, or so small that its rounding does not change the result.
    #[must_use]
    fn sub_exact_product(self, factor: Self, other: f64) -> Self;

    /// The nearest number to `self` between `-limit` and `limit`; NaN stays NaN.
    #[must_use]
    fn clamped(self, limit: f64) -> Self;

    /// Whether all lanes of all values are certainly within `±limit`. NaN is not.
    fn all_within(values: &[Self], limit: f64) -> bool;

    /// Sine and cosine of an angle, from those of its remainder. The lowest two bits of `self` are the number of
    /// quarter turns. An odd number exchanges the two, and the quadrant gives their signs.
    #[must_use]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self);

    /// Returns the number in a lane.
    fn lane(&self, lane: usize) -> f64;

    /// Puts a number into a lane.
    fn set_lane(&mut self, lane: usize, value: f64);
}

/// One arm.
impl Number for f64 {
    const LANES: usize = 1;

    #[inline(always)]
    fn sub_exact_product(self, factor: Self, other: f64) -> Self {
        self - factor * other
    }

    #[inline(always)]
    fn clamped(self, limit: f64) -> Self {
        self.clamp(-limit, limit)
    }

    #[inline(always)]
    fn all_within(values: &[Self], limit: f64) -> bool {
        values.iter().all(|value| value.abs() <= limit)
    }

    #[inline(always)]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self) {
        let quadrant = self.to_bits();
        let odd = 0_u64.wrapping_sub(quadrant & 1);
        let (sine, cosine) = (sine.to_bits(), cosine.to_bits());
        let exchange = (sine ^ cosine) & odd;
        let negative_sine = (quadrant & 2) << 62;
        let negative_cosine = (quadrant.wrapping_add(1) & 2) << 62;
        (
            Self::from_bits(sine ^ exchange ^ negative_sine),
            Self::from_bits(cosine ^ exchange ^ negative_cosine),
        )
    }

    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn set_lane(&mut self, _: usize, value: f64) {
        *self = value;
    }
}
