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

/// How many of the numbers `0..count` there are for which `holds`, which it does up to some number and then no more.
#[must_use]
pub fn partition_point(count: u64, holds: impl Fn(u64) -> bool) -> u64 {
    // Mostly for all of them.
    if count == 0 || holds(count - 1) {
        return count;
    }
    let (mut holding, mut end) = (0, count - 1);
    while holding < end {
        let middle = holding + (end - holding) / 2;
        if holds(middle) {
            holding = middle + 1;
        } else {
            end = middle;
        }
    }
    holding
}
