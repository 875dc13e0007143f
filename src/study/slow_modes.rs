//! Growth of a loop's slow modes beside fast ones a trillion times their rate.
//!
//! Eigenvalues of a matrix are good to some 1e-16 of the largest. At a damping rate of 1e12/s that says nothing of
//! a mode that grows by a factor e a second. The modes of a loop are also the zeros of the small matrix
//!
//! `P(λ) = λ² I + S + M⁻¹ (Kp + λ Kd + Ki/λ)`
//!
//! whose columns alone are large where a joint's gains are, so that elimination keeps the other digits. Newton's rule
//! on `log det P`, begun at an eigenvalue, brings a mode to its own last digits: `λ ↦ λ - 1 / tr(P⁻¹ P')`.
//!
//! Source: Lancaster, *Lambda-Matrices and Vibrating Systems* (1966), ch. 5.
//!
//! **Invariant:** the work is bounded, and a mode that does not converge counts for nothing.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over the joints of a matrix of their number"
)]

use super::linear::Linear;
use super::matrix::{Complex, Matrix, largest};

/// A mode is slow, and looked at here, if the fastest one is so many times faster.
const SLOWER: f64 = 1e-4;

/// Growth that counts, in parts of the mode's own rate: a thousand times what rounding leaves of a mode that is well
/// apart from others.
const GROWTH: f64 = 1e-9;

/// Rounds of Newton's rule, which takes five if two digits are right at the start.
const ROUNDS: u32 = 30;

/// A mode has converged if it moves by no more than this part of itself.
const SETTLED: f64 = 1e-12;

/// Whether a mode grows that is slow beside the fastest `rate` \[1/s\], and whose growth is less than `doubtful`
/// \[1/s\], so that rounding may have hidden it.
pub(super) fn grows(linear: &Linear, modes: &[Complex], rate: f64, doubtful: f64) -> bool {
    let is_slow = |mode: &&Complex| mode.modulus() < SLOWER * rate && mode.re.abs() < doubtful;
    let slow = modes.iter().filter(is_slow).count();
    if slow == 0 {
        return false;
    }
    // Eigenvalues of the whole loop may be too far off to begin at. The eigenvalues of the loop whose fast joints are
    // locked are not.
    let locked = locked_modes(linear, rate);
    modes
        .iter()
        .chain(&locked)
        .filter(is_slow)
        .filter_map(|mode| settled(linear, *mode))
        .any(|mode| mode.re > GROWTH * mode.modulus())
}

/// The modes of the loop with every joint locked that is fast by itself, and of the rest with its own fast ones locked.
fn locked_modes(linear: &Linear, rate: f64) -> Vec<Complex> {
    let mut modes = Vec::new();
    let (mut rest, mut rate) = (linear.clone(), rate);
    // Every round locks a joint, and the last one moves.
    while let Some(fast) = fast_joint(&rest, SLOWER * rate).filter(|_| rest.joints() > 1) {
        rest = locked(&rest, fast);
        if fast_joint(&rest, SLOWER * rate).is_none() {
            let found = rest.flow().eigenvalues();
            rate = largest(found.iter().map(|mode| mode.modulus()));
            modes.extend(found);
        }
    }
    modes
}

/// A joint whose own damping or spring is as fast as `least` \[1/s\].
fn fast_joint(linear: &Linear, least: f64) -> Option<usize> {
    (0..linear.joints()).find(|&j| {
        let ease = linear.inverse_mass[(j, j)];
        let own = (ease * linear.kd[j]).max((ease * linear.kp[j]).sqrt());
        own > least
    })
}

/// The loop without `joint`, which does not move: the holding effort acts on the others too.
fn locked(linear: &Linear, joint: usize) -> Linear {
    let (n, ease) = (linear.joints(), &linear.inverse_mass);
    let other = |i: usize| if i < joint { i } else { i + 1 };
    let without = |of: &Matrix| {
        Matrix::from_fn(n - 1, |i, j| {
            let (i, j) = (other(i), other(j));
            of[(i, j)] - ease[(i, joint)] / ease[(joint, joint)] * of[(joint, j)]
        })
    };
    let gains = |of: &[f64]| (0..n - 1).map(|i| of[other(i)]).collect();
    Linear {
        gravity: without(&linear.gravity),
        inverse_mass: without(ease),
        kp: gains(&linear.kp),
        kd: gains(&linear.kd),
        integrals: (0..n - 1)
            .filter_map(|i| {
                let mut of = linear.integrals.iter();
                of.find(|(at, _)| *at == other(i)).map(|(_, ki)| (i, *ki))
            })
            .collect(),
    }
}

/// The mode near `guess`, to its own last digits.
fn settled(linear: &Linear, guess: Complex) -> Option<Complex> {
    let mut mode = guess;
    for _ in 0..ROUNDS {
        let step = slope(linear, mode)?.reciprocal();
        mode = mode - step;
        // A value that is not finite never converges.
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
