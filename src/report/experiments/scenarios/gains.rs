//! S07 to S10: stiff, overdamped and undamped gains.
//!
//! **Invariant:** a limit is predicted before it is measured, and both are shown.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use super::support::{held, short, verdict};
use super::{Observation, Scenario};
use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::math::pid::Gains;
use crate::report::experiments::measure::{growth, measured_limit};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, largest_timestep};

pub(super) const SCENES: [Scenario; 4] = [
    Scenario {
        id: "S07",
        name: "stiff, kp 1e4",
        parameters: "2 links, kp 1e4, kd 200 and 60, setpoint (0.5, 0.8); all methods, held and continuous",
        expected: "measured limit within 1 % of the predicted one",
        slow: false,
        check: || {
            limits_hold(Gains {
                kp: [1e4; 2],
                ki: [0.0; 2],
                kd: [200.0, 60.0],
            })
        },
    },
    Scenario {
        id: "S08",
        name: "stiff, kp 1e6",
        parameters: "2 links, kp 1e6, kd 2000 and 600, setpoint (0.5, 0.8); all methods, held and continuous",
        expected: "measured limit within 1 % of the predicted one, a tenth of that at kp 1e4",
        slow: false,
        check: || {
            limits_hold(Gains {
                kp: [1e6; 2],
                ki: [0.0; 2],
                kd: [2000.0, 600.0],
            })
        },
    },
    Scenario {
        id: "S09",
        name: "overdamped",
        parameters: "2 links, kp 200, kd 500, setpoint (0.5, 0.8); all methods, held and continuous",
        expected: "measured limit within 1 % of the predicted one; 1 % beyond it the held arm chatters with period 2, \
                   bounded",
        slow: false,
        check: overdamped,
    },
    Scenario {
        id: "S10",
        name: "undamped",
        parameters: "2 links, gravity as usual, kp 1e4, kd 0, setpoint (0.5, 0.8)",
        expected: "held: every method unstable at every timestep; continuous: Euler and midpoint too, Verlet up to \
                   2/ω, Runge-Kutta 4 up to 2.828/ω",
        slow: false,
        check: undamped,
    },
];

const POSE: [f64; 2] = [0.5, 0.8];

/// Largest disagreement of prediction and measurement, and the limits held and continuous of Runge-Kutta 4.
fn compare(gains: Gains<2>) -> (f64, [Option<f64>; 2]) {
    let mut worst: f64 = 0.0;
    let mut rk4 = [None; 2];
    for method in Method::ALL {
        for (sampling, rk4) in Sampling::ALL.into_iter().zip(&mut rk4) {
            let control = held(gains, POSE).with_method(method);
            let linear = Linear::at_setpoint(&control);
            let predicted = largest_timestep(&linear, method, sampling);
            let measured =
                predicted.and_then(|limit| measured_limit(&control, sampling, 0.9 * limit));
            let ratio = measured
                .zip(predicted)
                .map(|(measured, predicted)| measured / predicted);
            worst = worst.max(ratio.map_or(f64::INFINITY, |ratio| (ratio - 1.0).abs()));
            // Methods are taken in order: the last one stays.
            *rk4 = measured;
        }
    }
    (worst, rk4)
}

fn limits_hold(gains: Gains<2>) -> Observation {
    let (worst, [held, continuous]) = compare(gains);
    verdict(
        worst < 0.01,
        format!(
            "off by {:.4} % at worst; Runge-Kutta 4 held {} s, continuous {} s",
            100.0 * worst,
            short(held),
            short(continuous)
        ),
    )
}

fn overdamped() -> Observation {
    let gains = Gains {
        kp: [200.0; 2],
        ki: [0.0; 2],
        kd: [500.0; 2],
    };
    let (worst, [at_held, continuous]) = compare(gains);
    let chatter = at_held.and_then(|limit| chatter(&held(gains, POSE).with_timestep(1.01 * limit)));
    verdict(
        worst < 0.01 && chatter.is_some(),
        format!(
            "off by {:.4} % at worst; Runge-Kutta 4 held {} s, continuous {} s; beyond: chatter of {} rad/s",
            100.0 * worst,
            short(at_held),
            short(continuous),
            short(chatter)
        ),
    )
}

/// How fast the arm goes to and fro after a long while, if it does so at every step.
fn chatter(control: &ControlLoop<2>) -> Option<f64> {
    let mut live = control.simulation(State::at_rest(POSE));
    live.advance(100_000);
    let mut alternates = true;
    let mut before = live.state().velocity[1];
    for _ in 0..100 {
        live.step();
        let now = live.state().velocity[1];
        alternates &= now * before < 0.0;
        before = now;
    }
    alternates.then_some(before.abs())
}

fn undamped() -> Observation {
    let gains = Gains {
        kp: [1e4; 2],
        ki: [0.0; 2],
        kd: [0.0; 2],
    };
    let still = held(gains, POSE);
    let linear = Linear::at_setpoint(&still);
    let fastest = crate::study::matrix::largest(
        linear
            .flow()
            .eigenvalues()
            .iter()
            .map(|mode| mode.modulus()),
    );
    let mut holds = true;
    let mut observed = vec![];
    for method in Method::ALL {
        let held = largest_timestep(&linear, method, Sampling::Held);
        let continuous = largest_timestep(&linear, method, Sampling::Continuous);
        // Where the region of stability ends on the imaginary axis, for Runge-Kutta methods by their order.
        let expected = match (method, method.order()) {
            (Method::Verlet, _) => 2.0,
            (_, 3) => 3.0_f64.sqrt(),
            (_, 4) => 8.0_f64.sqrt(),
            _ => 0.0,
        };
        holds &= held == Some(0.0);
        holds &= continuous.is_some_and(|limit| (limit * fastest - expected).abs() < 1e-4);
        // The arm itself: a deviation escapes within 4000 steps just beyond, and does not just below.
        let escapes = |part: f64| {
            let timestep = part * expected / fastest;
            let control = still.with_method(method).with_timestep(timestep);
            growth(&control, Sampling::Continuous).is_none()
        };
        if expected > 0.0 {
            holds &= escapes(1.02) && !escapes(0.98);
        }
        observed.push(format!("{method} {}", short(continuous)));
    }
    let grown = growth_time(&linear, 1e-4);
    observed.push(format!("midpoint at 0.1 ms grows e-fold in {grown:.0} s"));
    verdict(
        holds,
        format!("continuous: {}; held: none", observed.join(", ")),
    )
}

/// Time in which midpoint grows by e \[s\].
fn growth_time(linear: &Linear, h: f64) -> f64 {
    let step =
        crate::study::stability::step_matrix(linear, Method::Midpoint, Sampling::Continuous, h);
    h / step.spectral_radius().ln()
}
