//! A number of the arm's formulas: one for one arm, or a few registers full of them, a lane for each of several arms.
//!
//! Dynamics, methods and control law are written once, over [`Number`], and know no number of lanes. An operation is
//! done in all lanes alike. Two have to look at a lane by itself, the bound of an integral and the quadrant of an
//! angle: they select and do not branch.
//!
//! **Invariant:** every operation rounds once, to the nearest, as in IEEE 754, and none is fused with the next but
//! where that changes nothing. So a lane has the bits of the arm that is stepped alone, on every machine and in
//! registers of every width.

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

/// An array with an entry for each `$i`, its length that of where it goes; `$any` is any number of the kind.
///
/// A loop in place of [`std::array::from_fn`], whose closures the compiler may leave as functions of their own. There
/// the wide registers are not switched on, and every operation in them would be a call.
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

/// A number, or as many as a few registers have lanes. Constants are the same in all lanes.
pub trait Number: Arithmetic {
    /// How many numbers these are.
    const LANES: usize;

    /// `self - factor * other`, of a product that is exact, or so small that it changes nothing: whether it is rounded
    /// by itself, or not, is the same.
    #[must_use]
    fn sub_exact_product(self, factor: Self, other: f64) -> Self;

    /// The nearest number to `self` between `-limit` and `limit`; NaN stays NaN.
    #[must_use]
    fn clamped(self, limit: f64) -> Self;

    /// Whether all lanes of all values are sure to be within `±limit`; NaN is not.
    fn all_within(values: &[Self], limit: f64) -> bool;

    /// Sine and cosine of an angle, by those of its rest beyond a number of quarter turns, the lowest two bits of
    /// `self`. An odd number exchanges them, and their signs are those of the quadrant.
    #[must_use]
    fn turned(self, sine: Self, cosine: Self) -> (Self, Self);

    /// The number in a lane.
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
