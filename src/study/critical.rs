//! The motion that a loop loses first: the eigenvalue that leaves the unit circle at the limit, and the joint that
//! moves with it.
//!
//! **Invariant:** the work is bounded, and there is no answer where something is not finite.

use std::f64::consts::TAU;

use super::linear::Linear;
use super::matrix::{Complex, Matrix, largest};
use super::stability::{Modes, Sampling, Stepping};
use crate::math::elementary::{atan2, hypot};
use crate::math::integrator::Method;

/// The factor beyond its limit at which a loop is looked at: nothing grows at the limit itself.
pub const BEYOND: f64 = 1.1;

/// Steps of the inverse iteration; each brings the vector nearer by the ratio of two distances between eigenvalues.
const ITERATIONS: u32 = 6;

/// The motion that grows first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Critical {
    /// Factor by which it grows in a step of [`BEYOND`] times the limit.
    pub growth_per_step: f64,
    /// How often it swings \[Hz\]; half of the steps per second where it flips at every step.
    pub frequency: f64,
    /// The joint that it moves furthest, from 0.
    pub joint: usize,
}

/// The fastest growing motion of a loop with held control, beyond `limit` \[s\] (at a tiny timestep where that is
/// zero).
pub(super) fn critical(linear: &Linear, method: Method, limit: f64) -> Option<Critical> {
    let period = if limit > 0.0 {
        BEYOND * limit
    } else {
        Modes::of(linear).tiny()
    };
    let generator = Stepping::new(linear, method, Sampling::Held).generator(period);
    let growth = |mu: &Complex| 2.0 * mu.re + period * mu.modulus() * mu.modulus();
    let fastest = generator
        .eigenvalues()
        .into_iter()
        .max_by(|one, other| growth(one).total_cmp(&growth(other)))?;
    let (re, im) = (1.0 + period * fastest.re, period * fastest.im);
    let found = Critical {
        growth_per_step: hypot(re, im),
        frequency: atan2(im.abs(), re) / (TAU * period),
        joint: furthest(&generator, fastest, linear.joints())?,
    };
    (found.growth_per_step.is_finite() && found.frequency.is_finite()).then_some(found)
}

/// The largest of the first `joints` entries of an eigenvector. In real numbers: the plane in which an eigenvalue `a +
/// i b` turns is what `(E - a)² + b²` takes to zero, and with x in it, `x - i (E - a) x / b` is the eigenvector.
///
/// Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.6, on inverse iteration.
fn furthest(generator: &Matrix, mu: Complex, joints: usize) -> Option<usize> {
    let n = generator.size();
    // The shift lies a hair beside the eigenvalue, where the matrix would be singular.
    let shift = mu.re + 1e-6 * mu.modulus();
    let shifted = Matrix::from_fn(n, |i, j| {
        generator[(i, j)] - if i == j { shift } else { 0.0 }
    });
    let square = Matrix::from_fn(n, |i, j| if i == j { mu.im * mu.im } else { 0.0 })
        .plus(1.0, &shifted.product(&shifted));
    let matrix = if mu.im == 0.0 { &shifted } else { &square };
    let mut x = vec![1.0; n];
    for _ in 0..ITERATIONS {
        x = matrix.solve(&x)?;
        let length = largest(x.iter().map(|x| x.abs()));
        for x in &mut x {
            *x /= length;
        }
    }
    let image = |i: usize| -> f64 { x.iter().enumerate().map(|(j, x)| shifted[(i, j)] * x).sum() };
    let reach = |i: usize| {
        let across = if mu.im == 0.0 { 0.0 } else { image(i) / mu.im };
        x.get(i).map_or(0.0, |x| hypot(*x, across))
    };
    (0..joints).max_by(|&i, &j| reach(i).total_cmp(&reach(j)))
}
