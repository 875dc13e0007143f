//! Counts as floating-point numbers, and back.
//!
//! **Invariant:** the conversions are exact for counts up to 2^53.

/// A count as a double: exact up to 2^53, which no count here reaches.
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

/// The whole part of a number as a count: 0 below 1 and for NaN, `u64::MAX` where it is too large.
#[inline]
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast to an integer saturates, and NaN becomes 0"
)]
pub const fn whole(number: f64) -> u64 {
    number as u64
}

/// Bound on the relative rounding errors of a duration, such as 0.1 + 0.2, and of its quotient by a timestep.
pub const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// `duration / timestep`, increased by the bound on its rounding error. Rounded, it is the nearest number of steps, and
/// half a step counts as a whole one.
#[must_use]
pub fn steps_in(duration: f64, timestep: f64) -> f64 {
    duration / timestep * (1.0 + ROUNDING)
}

/// The number of values in `0..count` for which `holds` is true. It is true up to some value, and false from there on.
#[must_use]
pub fn partition_point(count: u64, holds: impl Fn(u64) -> bool) -> u64 {
    // In most calls it is true for all of them.
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
