//! S01 to S06: at rest, swinging, chaotic, with nobody at the controls.
//!
//! **Invariant:** no scene has a controller; all motion is free.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::FRAC_PI_2;

use super::support::{apart, arm, free, verdict};
use super::{Observation, Scenario};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::matrix::largest;
use crate::study::stability::{Sampling, step_matrix};

pub(super) const SCENES: [Scenario; 6] = [
    Scenario {
        id: "S01",
        name: "rest without gravity",
        parameters: "3 links, gravity 0, at rest, no control; 10^4 steps of 1 ms, all methods",
        expected: "the state keeps its bits",
        slow: false,
        check: rest_without_gravity,
    },
    Scenario {
        id: "S02",
        name: "hanging at rest",
        parameters: "3 links hanging at the double next to -π/2; 10^6 steps of 1 ms",
        expected: "midpoint, Verlet and Runge-Kutta 4 drift less than 1e-12 rad; under Euler rounding grows at the \
                   rate of its step matrix, to 2 %",
        slow: true,
        check: hanging_at_rest,
    },
    Scenario {
        id: "S03",
        name: "upright",
        parameters: "2 links, 1e-12 rad off upright; 3 s at 1 ms, all methods",
        expected: "leaves at the rate that the step matrix has, which is the unstable eigenvalue to the method's order",
        slow: false,
        check: upright,
    },
    Scenario {
        id: "S04",
        name: "regular swing",
        parameters: "2 links, 0.3 rad from hanging, 1000 s at 1 ms, all methods",
        expected: "energy: Euler gains over 1 J, midpoint gains under 1e-3 J, Verlet stays within 1e-4 J, Runge-Kutta \
                   4 within 1e-9 J",
        slow: true,
        check: regular_swing,
    },
    Scenario {
        id: "S05",
        name: "chaotic swing, 2 links",
        parameters: "2 links released from horizontal; 200 s at 1 ms, Runge-Kutta 4",
        expected: "neighbours part at 1.2 per second, give or take a quarter",
        slow: true,
        check: || chaotic::<2>([0.0; 2], 1.2),
    },
    Scenario {
        id: "S06",
        name: "chaotic swing, 3 links",
        parameters: "3 links released from horizontal; 200 s at 1 ms, Runge-Kutta 4",
        expected: "neighbours part at 1.9 per second, give or take a quarter",
        slow: true,
        check: || chaotic::<3>([0.0; 3], 1.9),
    },
];

fn rest_without_gravity() -> Observation {
    let start = State::at_rest([0.3, -1.2, 2.0]);
    let kept = arm([1.0; 3], 0.0).is_some_and(|arm| {
        Method::ALL.into_iter().all(|method| {
            let mut simulation = free(arm, start, method, 0.001);
            simulation.advance(10_000);
            *simulation.state() == start
        })
    });
    let observed = if kept { "every bit kept" } else { "moved" };
    verdict(kept, observed.to_owned())
}

/// `-π/2` is no double, so the arm hangs 6e-17 rad off and swings by that much.
fn hanging_at_rest() -> Observation {
    let start = State::at_rest([-FRAC_PI_2, 0.0, 0.0]);
    let linear = Linear::at_pose(&ControlLoop::free(Arm::<3>::default()), &start.position);
    let mut holds = true;
    let mut observed = vec![];
    for method in [Method::Midpoint, Method::Verlet, Method::Rk4] {
        let mut simulation = free(Arm::default(), start, method, 0.001);
        simulation.advance(1_000_000);
        let drift = apart(simulation.state(), &start);
        holds &= drift < 1e-12;
        observed.push(format!("{method} {drift:.1e}"));
    }
    let step = step_matrix(&linear, Method::Euler, Sampling::Held, 0.001);
    let predicted = step.spectral_radius().ln() / 0.001;
    let mut simulation = free(Arm::default(), start, Method::Euler, 0.001);
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
    holds &= (rate / predicted - 1.0).abs() < 0.02;
    observed.push(format!(
        "Euler grows by {rate:.5}/s, predicted {predicted:.5}/s"
    ));
    verdict(holds, format!("drift {}", observed.join(", ")))
}

fn upright() -> Observation {
    let pose = [FRAC_PI_2, 0.0];
    let h = 0.001;
    let linear = Linear::at_pose(&ControlLoop::free(Arm::default()), &pose);
    let unstable = largest(linear.flow().eigenvalues().iter().map(|mode| mode.re));
    let mut holds = true;
    let mut observed = vec![format!("eigenvalue {unstable:.5}/s")];
    for method in Method::ALL {
        let start = State {
            position: [pose[0] + 1e-12, 1e-12],
            velocity: [0.0; 2],
        };
        let mut simulation = free(Arm::default(), start, method, h);
        let mut off = |steps| {
            simulation.advance(steps);
            (simulation.state().position[0] - pose[0]).abs()
        };
        // After two seconds the fastest mode has outgrown the other one a few thousand times.
        let (early, late) = (off(2000), off(1000));
        let rate = (late / early).ln();
        let predicted = step_matrix(&linear, method, Sampling::Held, h)
            .spectral_radius()
            .ln()
            / h;
        holds &= (rate / predicted - 1.0).abs() < 2e-3;
        holds &= (predicted / unstable - 1.0).abs()
            < 2.0 * (unstable * h).powi(method.order().cast_signed());
        observed.push(format!("{method} {rate:.5}"));
    }
    verdict(holds, observed.join(", "))
}

fn regular_swing() -> Observation {
    let mut holds = true;
    let mut observed = vec![];
    for method in Method::ALL {
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
        holds &= match method {
            Method::Euler => highest > 1.0,
            Method::Midpoint => highest < 1e-3 && highest > -lowest,
            Method::Verlet => highest.max(-lowest) < 1e-4,
            // A method of order p gains or loses some h^(p-1).
            _ => highest.max(-lowest) < 1e-3_f64.powi(method.order().cast_signed() - 1),
        };
        observed.push(format!("{method} {lowest:+.1e} to {highest:+.1e} J"));
    }
    verdict(holds, observed.join(", "))
}

/// The rate at which two neighbours part, brought back together every tenth of a second.
fn chaotic<const N: usize>(position: [f64; N], expected: f64) -> Observation {
    const APART: f64 = 1e-8;
    let start = State::at_rest(position);
    let mut one = free(Arm::default(), start, Method::Rk4, 0.001);
    let mut other = one.clone();
    let mut beside = start;
    if let Some(first) = beside.position.first_mut() {
        *first += APART;
    }
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
        other.set_state(State {
            position: back(&here.position, &there.position),
            velocity: back(&here.velocity, &there.velocity),
        });
    }
    let rate = grown / 200.0;
    let observed = format!(
        "{rate:.2} per second: a unit of rounding is a radian after {:.0} s",
        36.0 / rate
    );
    verdict((rate / expected - 1.0).abs() < 0.25, observed)
}
