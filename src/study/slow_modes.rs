//! Growth of a loop's slow modes beside fast ones a trillion times their rate.
//!
//! Eigenvalues of a matrix are good to some 1e-16 of the largest. At a damping rate of 1e12/s that says nothing of
//! a mode that grows by a factor e a second. The modes of a loop are also the zeros of the small matrix
//!
//! `P(λ) = λ² I + S + M⁻¹ (Kp + λ Kd + Ki/λ)`
//!
//! A joint with large gains makes only its own column large, so that elimination keeps the other digits. Aberth's rule
//! brings all zeros of `det P` to their own last digits at once. It is Newton's rule on `log det P` with the other
//! zeros divided out, so that no two guesses come to the same zero:
//!
//! `λ ↦ λ - 1 / (tr(P⁻¹ P') - Σ 1 / (λ - λ_j))`
//!
//! Source: Lancaster, *Lambda-Matrices and Vibrating Systems* (1966), ch. 5; Aberth, *Mathematics of Computation* 27
//! (1973).
//!
//! **Invariant:** the work is bounded, and a mode that does not converge counts for nothing.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over the joints of a matrix of their number, and over the modes"
)]

use std::f64::consts::TAU;

use super::linear::Linear;
use super::matrix::Complex;
use crate::math::count::length_in_f64;
use crate::math::elementary::sin_cos;

/// A mode is slow, and looked at here, if the fastest one is so many times faster.
const SLOWER: f64 = 1e-4;

/// Growth that counts, in parts of the mode's own rate: a thousand times what rounding leaves of a mode that is well
/// apart from others.
const GROWTH: f64 = 1e-9;

/// Rounds of Aberth's rule. A mode that is begun at a thousand times its modulus takes some forty.
const ROUNDS: u32 = 100;

/// A mode has converged if it moves by no more than this part of itself.
const SETTLED: f64 = 1e-12;

/// Whether a mode grows that is slow beside the fastest `rate` \[1/s\], and whose growth is less than `doubtful`
/// \[1/s\], so that rounding may have hidden it.
pub(super) fn grows(linear: &Linear, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    let is_slow = |mode: &&Complex| mode.modulus() < SLOWER * rate && mode.re.abs() < doubtful;
    if !modes.iter().any(|mode| is_slow(&mode)) {
        return false;
    }
    let modes = settled(linear, modes, rate);
    let mut slow = modes.iter().filter(is_slow);
    slow.any(|mode| mode.re > GROWTH * mode.modulus())
}

/// The modes that converge, each to its own last digits. The search begins at the moduli of the `guesses`, each at an
/// angle of its own: rounding at the fastest `rate` \[1/s\] may have left no other digit of a guess.
fn settled(linear: &Linear, guesses: &[Complex], rate: f64) -> Vec<Complex> {
    let count = length_in_f64(guesses.len());
    let mut angle = 0.7;
    let mut modes: Vec<Complex> = guesses
        .iter()
        .map(|guess| {
            angle += TAU / count;
            let (im, re) = sin_cos(angle);
            Complex { re, im }.scaled(guess.modulus().max(f64::EPSILON * rate))
        })
        .collect();
    let mut has_settled = vec![false; modes.len()];
    for _ in 0..ROUNDS {
        for at in 0..modes.len() {
            let mode = modes[at];
            let others = (0..modes.len()).filter(|other| *other != at);
            let others = others.map(|other| (mode - modes[other]).reciprocal());
            let Some(slope) = slope(linear, mode).filter(|_| !has_settled[at]) else {
                continue;
            };
            let step = others.fold(slope, |sum, other| sum - other).reciprocal();
            // A value that is not finite never converges, and is no guess for the next round.
            if step.modulus().is_finite() {
                modes[at] = mode - step;
                has_settled[at] = step.modulus() <= SETTLED * modes[at].modulus();
            }
        }
    }
    let both = modes.into_iter().zip(has_settled);
    both.filter_map(|(mode, settled)| settled.then_some(mode))
        .collect()
}

/// `tr(P⁻¹ P')` at `at`, of the polynomial that `det P` is with a power of `λ` for each integral; by elimination.
/// `None` where `P` has no pivot.
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
    let integrals = length_in_f64(linear.integrals.len());
    let trace = (0..n).fold(Complex::ZERO, |sum, i| sum + derivative[i * n + i]);
    Some(trace + inverse.scaled(integrals))
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
