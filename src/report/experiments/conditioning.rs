//! Digits lost in the accelerations of an arm, by mass ratio, pose and solver.
//!
//! The reference is the Lagrangian with 106 bits ([`exact_acceleration`]). Two solvers are compared with it: the live
//! arm's recursion, and elimination of `M(q)` in joint space, as in textbooks. The inherent loss is the effect on the
//! reference of a change of the angles by half a unit in the last place. It is a scale, not a bound: the angles are exact.
//!
//! **Invariant:** every solver gets the same states.

use std::f64::consts::PI;

use super::reference::{DoubleDouble, exact_acceleration, largest_difference};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::{forward_dynamics, textbook};
use crate::study::matrix::largest;

/// Shape of the sampled poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseShape {
    /// Any angles.
    Bent,
    /// Outer angles of some 1e-6 rad: nearly a straight line, where eliminating a joint-space matrix loses most.
    Stretched,
    /// The second joint within 1e-8 to 0.1 rad of π, the third at any angle. The first two links coincide, and the
    /// third turns about a point near the base.
    Folded,
}

/// Digits lost at worst: `log10(relative error / 1.1e-16)`, at least 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    /// By the live arm's recursion.
    pub recursion: f64,
    /// By elimination of the joint-space mass matrix.
    pub dense: f64,
    /// By rounding the angles alone.
    pub inherent: f64,
}

impl PoseShape {
    /// This many states of a 3-link arm in such poses, each with efforts \[N m\].
    pub fn samples(self, count: usize) -> impl Iterator<Item = (State<3>, [f64; 3])> {
        // A fixed seed makes the report reproducible.
        let mut random = fastrand::Rng::with_seed(7);
        let mut any = move || 2.0 * random.f64() - 1.0;
        let sample = move || {
            let (second, third) = match self {
                Self::Bent => (PI * any(), PI * any()),
                Self::Stretched => (1e-6 * any(), 1e-6 * any()),
                Self::Folded => (PI - 10_f64.powf(-4.5 + 3.5 * any()), PI * any()),
            };
            let state = State {
                position: [PI * any(), second, third],
                velocity: [any(), any(), any()],
            };
            (state, [10.0 * any(), 10.0 * any(), 10.0 * any()])
        };
        std::iter::repeat_with(sample).take(count)
    }
}

/// Digits lost by an arm in the worst of these states, under these efforts \[N m\].
pub fn digits_lost<const N: usize>(
    arm: &Arm<N>,
    samples: impl IntoIterator<Item = (State<N>, [f64; N])>,
) -> Lost {
    let mut worst = Lost {
        recursion: 0.0,
        dense: 0.0,
        inherent: 0.0,
    };
    for (state, tau) in samples {
        let exact = exact_acceleration(arm, &state, &tau);
        let State { position, velocity } = &state;
        let found = forward_dynamics(arm, position, velocity, &tau);
        worst.recursion = lost(&exact, &found).max(worst.recursion);
        let dense = textbook(arm, position, velocity, &tau);
        worst.dense = lost(&exact, &dense).max(worst.dense);
        // The worst case of changing one joint alone, and all of them.
        let changes = (0..=N).map(|turned| {
            let mut nudged = state;
            for (i, q) in nudged.position.iter_mut().enumerate() {
                if turned == i || turned == N {
                    *q = q.next_up();
                }
            }
            let near = exact_acceleration(arm, &nudged, &tau).map(DoubleDouble::to_f64);
            // The neighbour is a whole unit away, so one bit is subtracted for half a unit.
            (lost(&exact, &near) - std::f64::consts::LOG10_2).max(0.0)
        });
        worst.inherent = changes.fold(worst.inherent, f64::max);
    }
    worst
}

/// Decimal digits that the worst of `values` has lost.
fn lost<const N: usize>(exact: &[DoubleDouble; N], values: &[f64; N]) -> f64 {
    let scale = largest(exact.iter().map(|value| value.abs().to_f64()));
    let error = largest_difference(exact, values) / scale;
    (error / (0.5 * f64::EPSILON)).log10().max(0.0)
}
