//! Growth of a loop's slow modes beside fast ones a trillion times their rate.
//!
//! Eigenvalues of a matrix are good to some 1e-16 of the largest. At a damping rate of 1e12/s that says nothing of
//! a mode that grows by a factor e a second. The matrix `(A - σ)⁻¹` has an eigenvalue `1 / (λ - σ)` for each mode λ.
//! With a shift σ of the mode's own size no eigenvalue is much larger than that of the mode, which keeps its digits.
//! The sizes are those of the eigenvalues of `A`, which have lost the slow modes, and of `A⁻¹`, which have lost the
//! fast ones. A joint with large gains makes only its own column large, so that elimination keeps the other digits.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.6.
//!
//! **Invariant:** the work is bounded, and growth that rounding may have made counts for nothing.

use super::linear::Linear;
use super::matrix::{Complex, Matrix};
use crate::math::elementary::hypot;

/// A mode is slow, and looked at here, if the fastest one is so many times faster.
const SLOWER: f64 = 1e-4;

/// Growth that counts, in parts of the mode's own rate: a thousand times what rounding leaves of a mode that is well
/// apart from others.
const GROWTH: f64 = 1e-9;

/// The shift of a mode, in its sizes: on the side of decay, and of no mode that only decays at its size.
const SHIFT: f64 = -1.3;

/// How many times larger or smaller than its size a mode may be to keep its digits.
const NEAR: f64 = 100.0;

/// Whether a mode grows that is slow beside the fastest `rate` \[1/s\], and whose growth is less than `doubtful`
/// \[1/s\], so that rounding may have hidden it.
pub(super) fn grows(linear: &Linear, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    let is_slow = |size: f64, growth: f64| size < SLOWER * rate && growth.abs() < doubtful;
    if !modes.iter().any(|mode| is_slow(mode.modulus(), mode.re)) {
        return false;
    }
    let flow = linear.flow();
    let times = flow.inverse().map_or_else(Vec::new, |it| it.eigenvalues());
    let sizes = modes.iter().map(|mode| mode.modulus());
    let mut sizes = sizes.chain(times.iter().map(|time| 1.0 / time.modulus()));
    sizes.any(|size| {
        let modes = shifted_modes(&flow, SHIFT * size);
        modes.into_iter().any(|(re, im)| {
            let modulus = hypot(re, im);
            let keeps_digits = modulus > size / NEAR && modulus < NEAR * size;
            keeps_digits && is_slow(modulus, re) && re > GROWTH * modulus
        })
    })
}

/// Real and imaginary parts of the modes by the eigenvalues of the shifted inverse; none where it is singular.
fn shifted_modes(flow: &Matrix, shift: f64) -> Vec<(f64, f64)> {
    let shifted = Matrix::from_fn(flow.size(), |row, column| {
        flow[(row, column)] - if row == column { shift } else { 0.0 }
    });
    let inverse = shifted.inverse();
    let times = inverse.map_or_else(Vec::new, |inverse| inverse.eigenvalues());
    let mode = |time: Complex| {
        let modulus = time.modulus();
        let parts = [time.re, -time.im].map(|part| part / modulus / modulus);
        (shift + parts[0], parts[1])
    };
    times.into_iter().map(mode).collect()
}
