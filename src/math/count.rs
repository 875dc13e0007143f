//! Counts as floating-point numbers.
//!
//! **Invariant:** the number is the count itself: none is rounded below 2^53.

/// A count as a double: exact up to 2^53, more than anything here counts.
#[inline]
#[must_use]
#[allow(clippy::cast_precision_loss, reason = "counts are below 2^53")]
pub const fn in_f64(count: u64) -> f64 {
    count as f64
}

/// A length as a double, as [`in_f64`].
#[inline]
#[must_use]
pub const fn length_in_f64(length: usize) -> f64 {
    in_f64(length as u64)
}
