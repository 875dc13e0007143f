//! Growth of slow modes in a loop whose fast modes have up to a trillion times their rate.
//!
//! Computed eigenvalues have errors of some 1e-16 of the largest one. At a damping rate of 1e12/s this hides a mode
//! that grows by a factor e per second. The matrix `(A - σ)⁻¹` has an eigenvalue `1 / (λ - σ)` for each mode λ. With a
//! shift σ of the mode's own size no eigenvalue is much larger than that of the mode, so its digits are kept. The sizes
//! come from the eigenvalues of `A`, which are inaccurate for slow modes, and of `A⁻¹`, inaccurate for fast ones. A
//! joint with large gains makes only its own column large, so elimination keeps the digits of the other columns.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.6.
//!
//! **Invariant:** the work is bounded, and growth within rounding error does not count.

use super::matrix::{Complex, Matrix};

/// A mode is slow if its rate is below this part of the fastest rate.
const SLOWER: f64 = 1e-4;

/// Least growth that counts, relative to the mode's own rate: a thousand times the rounding error of a well separated
/// mode.
const GROWTH: f64 = 1e-9;

/// The shift relative to the mode's size. It is negative, on the side of decay, and differs from a purely decaying mode
/// of this size.
const SHIFT: f64 = -1.3;

/// Largest ratio between a mode and the assumed size at which the mode keeps its digits.
const NEAR: f64 = 100.0;

/// Whether a mode grows that is slow compared with the fastest `rate` \[1/s\]. Its growth is less than `doubtful`
/// \[1/s\], so rounding may have hidden it.
pub(super) fn grows(flow: &Matrix, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    let is_slow = |size: f64, growth: f64| size < SLOWER * rate && growth.abs() < doubtful;
    if !modes.iter().any(|mode| is_slow(mode.modulus(), mode.re)) {
        return false;
    }
    let sizes = [modes, &shifted_modes(flow, 0.0)].concat();
    sizes.into_iter().map(Complex::modulus).any(|size| {
        shifted_modes(flow, SHIFT * size).into_iter().any(|mode| {
            let modulus = mode.modulus();
            let keeps_digits = modulus > size / NEAR && modulus < NEAR * size;
            keeps_digits && is_slow(modulus, mode.re) && mode.re > GROWTH * modulus
        })
    })
}

/// The modes, from the eigenvalues of the shifted inverse; empty if the matrix is singular.
fn shifted_modes(flow: &Matrix, shift: f64) -> Vec<Complex> {
    let inverse = flow.clone().plus_diagonal(-shift).inverse();
    let times = inverse.map_or_else(Vec::new, |inverse| inverse.eigenvalues());
    let mode = |time: Complex| {
        let modulus = time.modulus();
        Complex {
            re: shift + time.re / modulus / modulus,
            im: -time.im / modulus / modulus,
        }
    };
    times.into_iter().map(mode).collect()
}
