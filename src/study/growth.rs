//! How much a small deviation of the arm itself grows per control period: what the spectral radius predicts.
//!
//! The arm is nudged off its equilibrium, and after every period its deviation (position, velocity, integral) is scaled back to the size
//! of the nudge, so that the fastest mode alone is left and neither dies in rounding nor leaves what is linear.
//!
//! **Invariant:** no prediction enters but the equilibrium.

use super::linear::equilibrium;
use super::measure::{Setting, moved, nudged};
use crate::math::arm::State;
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::increment;
use crate::math::pid::Pid;

/// Size to which deviations are scaled back \[rad\]: small, so that what is linear shows, and a billion units of rounding.
const SIZE: f64 = 1e-6;

/// Periods before counting starts, in which all modes but the fastest fall behind.
const BEFORE: u32 = 2000;

/// Periods over which the growth is averaged: where in a swing they begin and end then matters less than 0.1 %.
const COUNTED: u32 = 4000;

/// Mean factor by which a deviation grows per control `period` \[s\] of `substeps` steps of the setting's method, the effort held over
/// it; `None` if it is not finite.
#[must_use]
pub fn growth_per_period<const N: usize>(
    setting: &Setting<N>,
    period: f64,
    substeps: u32,
) -> Option<f64> {
    let rest = equilibrium(&setting.arm, &setting.gains, &setting.setpoint);
    let mut state = nudged(&rest.position, period);
    let mut pid = Pid::new(setting.gains);
    pid.set_setpoint(setting.setpoint);
    pid.enable(true);
    pid.commit(rest.integral);
    let integrates = setting.gains.ki.map(|ki| ki > 0.0);
    let mut logarithm = 0.0;
    for count in 0..BEFORE + COUNTED {
        let integral = held_period(setting, &mut pid, &mut state, period, substeps.max(1));
        let moved = difference(&state.position, &rest.position);
        let mut gathered = difference(&integral, &rest.integral);
        for (gathered, integrates) in gathered.iter_mut().zip(integrates) {
            // An integral that acts on nothing only drifts.
            if !integrates {
                *gathered = 0.0;
            }
        }
        let sizes = [
            largest(&moved),
            period * largest(&state.velocity),
            largest(&gathered),
        ];
        let size = largest(&sizes);
        if !size.is_finite() {
            return None;
        }
        if size == 0.0 {
            return Some(0.0);
        }
        let back = SIZE / size;
        state = State {
            position: sum(&rest.position, &moved, back),
            velocity: state.velocity.map(|velocity| velocity * back),
        };
        pid.commit(sum(&rest.integral, &gathered, back));
        if count >= BEFORE {
            logarithm -= back.ln();
        }
    }
    Some((logarithm / f64::from(COUNTED)).exp())
}

/// One period of the loop; answers the integral after it.
fn held_period<const N: usize>(
    setting: &Setting<N>,
    pid: &mut Pid<N>,
    state: &mut State<N>,
    period: f64,
    substeps: u32,
) -> [f64; N] {
    let control = pid.control(state, period);
    for _ in 0..substeps {
        let (dq, dv) = increment(
            setting.method,
            |_, q, v| forward_dynamics(&setting.arm, q, v, &control.effort),
            0.0,
            &state.position,
            &state.velocity,
            period / f64::from(substeps),
        );
        *state = moved(state, &dq, &dv);
    }
    control.integral
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

/// Largest absolute value; NaN if one is.
fn largest<const N: usize>(values: &[f64; N]) -> f64 {
    values.iter().fold(0.0, |most, value| {
        if value.abs() > most || value.is_nan() {
            value.abs()
        } else {
            most
        }
    })
}
