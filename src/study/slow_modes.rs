//! Growth of a loop's slow modes beside fast ones a trillion times their rate.
//!
//! Eigenvalues of a matrix are good to some 1e-16 of the largest, which at a damping rate of 1e12/s says nothing of a mode
//! that grows by a factor e a second. The modes of a loop are also the zeros of the small matrix
//!
//! `P(λ) = λ² I + S + M⁻¹ (Kp + λ Kd + Ki/λ)`
//!
//! whose columns alone are large where a joint's gains are, so that elimination keeps the digits of the rest. Newton's
//! rule on `log det P`, begun at an eigenvalue, brings a mode to its own last digits: `λ ↦ λ - 1 / tr(P⁻¹ P')`.
//!
//! Source: Lancaster, *Lambda-Matrices and Vibrating Systems* (1966), ch. 5.
//!
//! **Invariant:** bounded work; a mode that does not settle says nothing.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over the joints of a matrix of their number"
)]

use super::linear::Linear;
use super::matrix::Complex;

/// A mode is slow, and looked at here, if the fastest one is so many times faster.
const SLOWER: f64 = 1e-4;

/// Growth that counts, in parts of the mode's own rate: a thousand times what rounding leaves of a mode that is well
/// apart from others.
const GROWTH: f64 = 1e-9;

/// Rounds of Newton's rule: begun with two right digits it takes five.
const ROUNDS: u32 = 30;

/// A mode has settled if it moves by no more than this part of itself.
const SETTLED: f64 = 1e-12;

/// Whether one of the `modes` that are slow beside the fastest `rate` \[1/s\] grows, whatever rounding made of its sign.
pub(super) fn grows(linear: &Linear, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    modes
        .iter()
        .filter(|mode| mode.modulus() < SLOWER * rate && mode.re.abs() < doubtful)
        .filter_map(|mode| settled(linear, *mode))
        .any(|mode| mode.re > GROWTH * mode.modulus())
}

/// The mode near `guess`, to its own last digits.
fn settled(linear: &Linear, guess: Complex) -> Option<Complex> {
    let mut mode = guess;
    for _ in 0..ROUNDS {
        let step = slope(linear, mode)?.reciprocal();
        mode = mode - step;
        // Not finite never settles.
        if step.modulus() <= SETTLED * mode.modulus() {
            return Some(mode);
        }
    }
    None
}

/// `tr(P⁻¹ P')` at `at`, by elimination; `None` where `P` has no pivot.
fn slope(linear: &Linear, at: Complex) -> Option<Complex> {
    let n = linear.joints();
    let (mut p, mut derivative) = (vec![Complex::ZERO; n * n], vec![Complex::ZERO; n * n]);
    let inverse = at.reciprocal();
    for row in 0..n {
        for column in 0..n {
            let ki: f64 = linear
                .integrals
                .iter()
                .filter(|(joint, _)| *joint == column)
                .map(|(_, ki)| ki)
                .sum();
            let law = Complex::real(linear.kp[column])
                + at.scaled(linear.kd[column])
                + inverse.scaled(ki);
            let law_slope = Complex::real(linear.kd[column]) - (inverse * inverse).scaled(ki);
            let pull = linear.inverse_mass[(row, column)];
            let (mut entry, mut entry_slope) = (law.scaled(pull), law_slope.scaled(pull));
            entry = entry + Complex::real(linear.gravity[(row, column)]);
            if row == column {
                entry = entry + at * at;
                entry_slope = entry_slope + at.scaled(2.0);
            }
            p[row * n + column] = entry;
            derivative[row * n + column] = entry_slope;
        }
    }
    eliminate(&mut p, &mut derivative, n)?;
    Some((0..n).fold(Complex::ZERO, |sum, i| sum + derivative[i * n + i]))
}

/// Leaves `p⁻¹ right` in `right`, by Gauss and Jordan with the largest pivot of each column.
fn eliminate(p: &mut [Complex], right: &mut [Complex], n: usize) -> Option<()> {
    for k in 0..n {
        let size = |row: &usize| p[row * n + k].modulus();
        let pivot = (k..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let inverse = p[pivot * n + k].reciprocal();
        if !inverse.modulus().is_finite() {
            return None;
        }
        for column in 0..n {
            p.swap(k * n + column, pivot * n + column);
            right.swap(k * n + column, pivot * n + column);
        }
        for column in 0..n {
            p[k * n + column] = p[k * n + column] * inverse;
            right[k * n + column] = right[k * n + column] * inverse;
        }
        for row in (0..n).filter(|row| *row != k) {
            let factor = p[row * n + k];
            for column in 0..n {
                p[row * n + column] = p[row * n + column] - factor * p[k * n + column];
                right[row * n + column] = right[row * n + column] - factor * right[k * n + column];
            }
        }
    }
    Some(())
}
