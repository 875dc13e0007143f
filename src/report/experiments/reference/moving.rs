//! A setpoint that moves: from one pose to another along a polynomial, at rest at both ends.
//!
//! `q*(t) = a + (b - a) (10 s³ - 15 s⁴ + 6 s⁵)`, `s = t / T`: what a planner sends, with velocity and acceleration zero
//! at both ends.
//!
//! **Invariant:** in doubles and in double-double it is one and the same motion, to rounding.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over the coefficients of a polynomial"
)]

use super::double_double::DoubleDouble as Real;
use crate::math::pid::Setpoint;

/// Degree of a setpoint's motion.
pub(super) const DEGREE: usize = 5;

/// Coefficients in time, of one polynomial per joint.
pub(super) type Polynomial<const N: usize> = [[Real; N]; DEGREE + 1];

/// A setpoint on its way from one pose to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingSetpoint<const N: usize> {
    /// Where it begins \[rad\].
    pub from: [f64; N],
    /// Where it ends, and stays \[rad\].
    pub to: [f64; N],
    /// How long it takes \[s\].
    pub duration: f64,
}

impl<const N: usize> MovingSetpoint<N> {
    /// Position and velocity at `time` \[s\].
    #[must_use]
    pub fn at(&self, time: f64) -> Setpoint<N> {
        let s = (time / self.duration).clamp(0.0, 1.0);
        let way = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let speed = 30.0 * (s * (1.0 - s)).powi(2) / self.duration;
        Setpoint {
            position: std::array::from_fn(|i| self.from[i] + (self.to[i] - self.from[i]) * way),
            velocity: std::array::from_fn(|i| (self.to[i] - self.from[i]) * speed),
        }
    }

    /// Positions and velocities as polynomials in the time from the start, which hold until the end.
    pub(super) fn polynomials(&self) -> (Polynomial<N>, Polynomial<N>) {
        let duration = Real::from(self.duration);
        let mut position = constant(&self.from);
        let mut power = duration * duration;
        for (k, share) in [(3, 10.0), (4, -15.0), (5, 6.0)] {
            power = power * duration;
            position[k] = std::array::from_fn(|i| {
                (Real::from(self.to[i]) - Real::from(self.from[i])) * Real::from(share) / power
            });
        }
        let mut velocity = constant(&[0.0; N]);
        for (k, factor) in [(3, 3.0), (4, 4.0), (5, 5.0)] {
            velocity[k - 1] = position[k].map(|value| value * Real::from(factor));
        }
        (position, velocity)
    }
}

/// Polynomials that do not move.
pub(super) fn constant<const N: usize>(values: &[f64; N]) -> Polynomial<N> {
    let mut polynomial = [[Real::ZERO; N]; DEGREE + 1];
    polynomial[0] = values.map(Real::from);
    polynomial
}

/// The same polynomials in the time that begins `step` \[s\] later.
pub(super) fn shift<const N: usize>(polynomial: &mut Polynomial<N>, step: Real) {
    for first in 0..DEGREE {
        for k in (first..DEGREE).rev() {
            let above = polynomial[k + 1];
            for (value, above) in polynomial[k].iter_mut().zip(above) {
                *value += step * above;
            }
        }
    }
}
