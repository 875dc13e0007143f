//! Growth of a loop's slow modes beside fast ones a trillion times their rate.
//!
//! Eigenvalues of a matrix are good to some 1e-16 of the largest. At a damping rate of 1e12/s that says nothing of
//! a mode that grows by a factor e a second. The inverse matrix has the reciprocals for eigenvalues, and there the slow
//! modes are the large ones. A joint with large gains makes only its own column large, so that elimination keeps the
//! other digits.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.6.
//!
//! **Invariant:** the work is bounded, and growth that rounding may have made counts for nothing.

use super::linear::Linear;
use super::matrix::{Complex, largest};

/// A mode is slow, and looked at here, if the fastest one is so many times faster.
const SLOWER: f64 = 1e-4;

/// Growth that counts, in parts of the mode's own rate.
const GROWTH: f64 = 1e-9;

/// Growth that rounding can feign, in parts of the largest eigenvalue of the inverse.
const NOISE: f64 = 1e-13;

/// Whether a mode grows that is slow beside the fastest `rate` \[1/s\], and whose growth is less than `doubtful`
/// \[1/s\], so that rounding may have hidden it.
pub(super) fn grows(linear: &Linear, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    let is_slow = |modulus: f64, growth: f64| modulus < SLOWER * rate && growth.abs() < doubtful;
    if !modes.iter().any(|mode| is_slow(mode.modulus(), mode.re)) {
        return false;
    }
    let Some(inverse) = linear.flow().inverse() else {
        return false;
    };
    let times = inverse.eigenvalues();
    let noise = NOISE * largest(times.iter().map(|time| time.modulus()));
    // The reciprocal of a time has its conjugate's direction.
    times.iter().any(|time| {
        let modulus = time.modulus();
        time.re > GROWTH * modulus + noise && is_slow(1.0 / modulus, time.re / modulus / modulus)
    })
}
