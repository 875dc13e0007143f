//! How much a small deviation of the arm itself grows per control period: the spectral radius predicts it.
//!
//! The arm is nudged off its equilibrium. After every period its deviation (position, velocity, integral) is scaled
//! back to the size of the nudge. So the fastest mode alone is left, and neither dies in rounding nor leaves the linear
//! range.
//!
//! **Invariant:** no prediction enters but the equilibrium.

use super::measure::{in_substeps, live_at, nudged};
use crate::math::arm::State;
use crate::math::simulation::{Checkpoint, Simulation};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::equilibrium;
use crate::study::matrix;

/// Size to which deviations are scaled back \[rad\]: small, so that what is linear shows, and a billion units of
/// rounding.
const SIZE: f64 = 1e-6;

/// Periods before counting starts, in which all modes but the fastest fall behind.
const BEFORE: u32 = 2000;

/// Periods over which the growth is averaged: where in a swing they begin and end then matters less than 0.1 %.
const COUNTED: u32 = 4000;

/// Mean factor by which a deviation grows per control period of `substeps` steps, the effort held over it; the loop's
/// timestep is the period. `None` if it is not finite.
#[must_use]
pub fn growth_per_period<const N: usize>(control: &ControlLoop<N>, substeps: u32) -> Option<f64> {
    let period = control.timestep;
    let control = in_substeps(control, substeps, false);
    let rest = equilibrium(&control);
    let mut live = live_at(&control, &rest, nudged(&control, &rest.position));
    let mut logarithm = 0.0;
    for count in 0..BEFORE + COUNTED {
        live.advance(substeps.into());
        let State { position, velocity } = *live.state();
        let moved = difference(&position, &rest.position);
        let mut gathered = difference(live.pid().integral(), &rest.integral);
        for (gathered, integrates) in gathered.iter_mut().zip(control.integrating()) {
            // An integral that acts on nothing only drifts.
            if !integrates {
                *gathered = 0.0;
            }
        }
        let sizes = [
            largest(&moved),
            period * largest(&velocity),
            largest(&gathered),
        ];
        let size = largest(&sizes);
        if live.divergence().is_some() {
            return None;
        }
        if size == 0.0 {
            return Some(0.0);
        }
        let back = SIZE / size;
        let scaled = State {
            position: sum(&rest.position, &moved, back),
            velocity: velocity.map(|velocity| velocity * back),
        };
        live = Simulation::continued(&Checkpoint {
            state: scaled,
            carry: State::rest(),
            integral: sum(&rest.integral, &gathered, back),
            ..live.checkpoint()
        });
        if count >= BEFORE {
            logarithm -= back.ln();
        }
    }
    Some((logarithm / f64::from(COUNTED)).exp())
}

fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    sum(a, b, -1.0)
}

#[allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays of N"
)]
fn sum<const N: usize>(a: &[f64; N], b: &[f64; N], factor: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + factor * b[i])
}

fn largest<const N: usize>(values: &[f64; N]) -> f64 {
    matrix::largest(values.iter().map(|value| value.abs()))
}
