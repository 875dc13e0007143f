//! The first unstable mode, whose eigenvalue leaves the unit circle at the limit, and the joint that moves most in it.
//!
//! **Invariant:** the work is bounded, and the result is `None` if a value is not finite or nothing grows.

use std::f64::consts::TAU;

use libm::{atan2, hypot};

use super::control_loop::ControlLoop;
use super::linear::Linear;
use super::matrix::{Complex, Matrix};
use super::stability::{Modes, NEUTRAL, Sampling, Stepping};

/// The loop is analysed at this multiple of its limit, since nothing grows at the limit itself.
pub const BEYOND: f64 = 1.1;

/// The first unstable mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Critical {
    /// Factor by which it grows in a step of [`BEYOND`] times the limit, 1 if the growth is below rounding.
    pub growth_per_step: f64,
    /// Its frequency \[Hz\]. If it changes sign at every step, this is half of the steps per second.
    pub frequency: f64,
    /// The joint with the largest amplitude, counted from 0.
    pub joint: usize,
}

/// The fastest growing mode of a loop with held control, beyond `limit` \[s\]. If the limit is zero, the timestep is
/// tiny.
pub(super) fn critical<const N: usize>(
    linear: &Linear,
    control: &ControlLoop<N>,
    limit: f64,
) -> Option<Critical> {
    let period = if limit > 0.0 {
        BEYOND * limit
    } else {
        Modes::of(linear).tiny()
    };
    let stepping = Stepping::of(linear, control, Sampling::Held);
    // Beyond a narrow unstable interval the loop is stable again.
    if stepping.growth(period) < -NEUTRAL {
        return None;
    }
    let generator = stepping.generator(period);
    let fastest = fastest(&generator, period)?;
    let (re, im) = (1.0 + period * fastest.re, period * fastest.im);
    let found = Critical {
        growth_per_step: hypot(re, im).max(1.0),
        frequency: atan2(im.abs(), re) / (TAU * period),
        joint: furthest(&generator, fastest, linear.joints())?,
    };
    (found.growth_per_step.is_finite() && found.frequency.is_finite()).then_some(found)
}

/// The eigenvalue of `E` in `x ↦ (I + T E) x` whose mode grows fastest.
pub(super) fn fastest(generator: &Matrix, period: f64) -> Option<Complex> {
    let growth = |mu: &Complex| 2.0 * mu.re + period * mu.modulus() * mu.modulus();
    let values = generator.eigenvalues().into_iter();
    // The zero of a joint that only drifts is exact, and limits nothing.
    let moving = values.filter(|mu| mu.modulus() != 0.0);
    moving.max_by(|one, other| growth(one).total_cmp(&growth(other)))
}

/// The index of the largest of the first `joints` entries of an eigenvector.
fn furthest(generator: &Matrix, mu: Complex, joints: usize) -> Option<usize> {
    let shape = shape(generator, mu)?;
    (0..joints).max_by(|&i, &j| shape[i].modulus().total_cmp(&shape[j].modulus()))
}

/// An eigenvector, in real arithmetic. For the eigenvalue `a + i b`, the invariant plane is the null space of
/// `(E - a)² + b²`. If x lies in it, `x - i (E - a) x / b` is the eigenvector.
pub(super) fn shape(generator: &Matrix, mu: Complex) -> Option<Vec<Complex>> {
    // The shift is slightly off the eigenvalue, where the matrix would be singular.
    let shift = mu.re + 1e-6 * mu.modulus();
    let shifted = generator.clone().plus_diagonal(-shift);
    let square = shifted.product(&shifted).plus_diagonal(mu.im * mu.im);
    let matrix = if mu.im == 0.0 { &shifted } else { &square };
    let x = matrix.most_shortened()?;
    let image = |i: usize| -> f64 { x.iter().enumerate().map(|(j, x)| shifted[(i, j)] * x).sum() };
    let entry = |(i, re): (usize, &f64)| Complex {
        re: *re,
        im: if mu.im == 0.0 { 0.0 } else { -image(i) / mu.im },
    };
    Some(x.iter().enumerate().map(entry).collect())
}
