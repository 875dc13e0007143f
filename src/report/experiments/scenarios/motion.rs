//! S01 to S06: at rest, swinging, chaotic, with nobody at the controls.
//!
//! **Invariant:** no scene has a controller; all motion is free.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::FRAC_PI_2;

use super::support::{Named, Observation, apart, arm, each, free, is_near, verdict};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::matrix::largest;
use crate::study::stability::{Sampling, step_matrix};

/// The checks of S01 to S06.
pub(super) const CHECKS: [Named; 6] = [
    ("S01", rest_without_gravity),
    ("S02", hanging_at_rest),
    ("S03", upright),
    ("S04", regular_swing),
    ("S05", || chaotic::<2>(1.2)),
    ("S06", || chaotic::<3>(1.9)),
];

fn rest_without_gravity() -> Observation {
    let start = State::at_rest([0.3, -1.2, 2.0]);
    let kept = Method::ALL.into_iter().all(|method| {
        let mut simulation = free(arm([1.0; 3], 0.0), start, method, 0.001);
        simulation.advance(10_000);
        *simulation.state() == start
    });
    verdict(kept, if kept { "every bit kept" } else { "moved" })
}

/// The rate at which a deviation grows under a method at 1 ms \[1/s\], as the step matrix says.
fn predicted_rate(linear: &Linear, method: Method) -> f64 {
    let step = step_matrix(linear, method, Sampling::Held, 0.001);
    step.spectral_radius().ln() / 0.001
}

/// `-π/2` is no double, so the arm hangs 6e-17 rad off and swings by that much.
fn hanging_at_rest() -> Observation {
    let start = State::at_rest([-FRAC_PI_2, 0.0, 0.0]);
    let linear = Linear::at_pose(&ControlLoop::free(Arm::<3>::default()), &start.position);
    let swinging = |method| free(Arm::default(), start, method, 0.001);
    let drifts = [Method::Midpoint, Method::Verlet, Method::Rk4].map(|method| {
        let mut simulation = swinging(method);
        simulation.advance(1_000_000);
        let drift = apart(simulation.state(), &start);
        (drift < 1e-12, format!("{method} drifts {drift:.1e}"))
    });
    let predicted = predicted_rate(&linear, Method::Euler);
    let mut simulation = swinging(Method::Euler);
    // The largest within a second, longer than the fastest swing.
    let mut largest_after = |steps| {
        simulation.advance(steps);
        largest((0..1000).map(|_| {
            simulation.step();
            apart(simulation.state(), &start)
        }))
    };
    let (early, late) = (largest_after(200_000), largest_after(199_000));
    let rate = (late / early).ln() / 200.0;
    let words = format!("Euler grows by {rate:.5}/s, predicted {predicted:.5}/s");
    let grows = (is_near(Some(rate), predicted, 0.02), words);
    each(drifts.into_iter().chain([grows]))
}

fn upright() -> Observation {
    let pose = [FRAC_PI_2, 0.0];
    let linear = Linear::at_pose(&ControlLoop::free(Arm::default()), &pose);
    let unstable = largest(linear.flow().eigenvalues().iter().map(|mode| mode.re));
    let eigenvalue = (true, format!("eigenvalue {unstable:.5}/s"));
    each([eigenvalue].into_iter().chain(Method::ALL.map(|method| {
        let start = State::at_rest([pose[0] + 1e-12, 1e-12]);
        let mut simulation = free(Arm::default(), start, method, 0.001);
        let mut off = |steps| {
            simulation.advance(steps);
            (simulation.state().position[0] - pose[0]).abs()
        };
        // After two seconds the fastest mode has outgrown the other one a few thousand times.
        let (early, late) = (off(2000), off(1000));
        let rate = (late / early).ln();
        let predicted = predicted_rate(&linear, method);
        let order = (unstable * 0.001).powi(method.order().cast_signed());
        let holds =
            is_near(Some(rate), predicted, 2e-3) && is_near(Some(predicted), unstable, 2.0 * order);
        (holds, format!("{method} {rate:.5}"))
    })))
}

fn regular_swing() -> Observation {
    each(Method::ALL.map(|method| {
        let start = State::at_rest([0.3 - FRAC_PI_2, 0.0]);
        let mut simulation = free(Arm::default(), start, method, 0.001);
        let begun = energy(simulation.arm(), &start);
        let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
        for _ in 0..10_000 {
            simulation.advance(100);
            let gained = energy(simulation.arm(), simulation.state()) - begun;
            lowest = lowest.min(gained);
            highest = highest.max(gained);
        }
        let holds = match method {
            Method::Euler => highest > 1.0,
            Method::Midpoint => highest < 1e-3 && highest > -lowest,
            Method::Verlet => highest.max(-lowest) < 1e-4,
            // A method of order p gains or loses some h^(p-1).
            _ => highest.max(-lowest) < 1e-3_f64.powi(method.order().cast_signed() - 1),
        };
        (holds, format!("{method} {lowest:+.1e} to {highest:+.1e} J"))
    }))
}

/// The rate at which two neighbours part, brought back together every tenth of a second.
fn chaotic<const N: usize>(expected: f64) -> Observation {
    const APART: f64 = 1e-8;
    let mut one = free(Arm::default(), State::rest(), Method::Rk4, 0.001);
    let mut other = one.clone();
    let mut beside = State::<N>::rest();
    beside.position[0] += APART;
    other.set_state(beside);
    let mut grown = 0.0;
    for _ in 0..2000 {
        one.advance(100);
        other.advance(100);
        let (here, there) = (*one.state(), *other.state());
        let distance = apart(&here, &there);
        grown += (distance / APART).ln();
        let back = |here: &[f64; N], there: &[f64; N]| {
            std::array::from_fn(|i| here[i] + (there[i] - here[i]) * APART / distance)
        };
        let position = back(&here.position, &there.position);
        let velocity = back(&here.velocity, &there.velocity);
        other.set_state(State { position, velocity });
    }
    let rate = grown / 200.0;
    let reached = 36.0 / rate;
    let words =
        format!("{rate:.2} per second: a unit of rounding is a radian after {reached:.0} s");
    verdict(is_near(Some(rate), expected, 0.25), words)
}
