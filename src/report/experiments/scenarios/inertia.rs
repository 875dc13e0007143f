//! S16 to S26: light and heavy outer links, short and long links, stretched, folded, whirling.
//!
//! **Invariant:** accelerations are compared with ones in twice the digits, measured limits with predicted ones.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, PI};

use super::support::{arm, digits_lost, free, held, short, states, verdict};
use super::{Observation, Scenario};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::Method;
use crate::math::pid::Gains;
use crate::report::experiments::measure::{boundary, measured_limit};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::matrix::{Matrix, largest};
use crate::study::stability::{Sampling, largest_timestep, limits};

/// Digits that a rod arm may lose: a half-unit change of an angle alone changes accelerations by up to 1.6 digits.
const DIGITS: f64 = 2.5;

const LIGHT: &str = "worst of 200 states loses at most 2.5 digits; the limit falls with the tip's inertia, measured \
                     within 1 % of predicted";
const HEAVY: &str = "worst of 200 states loses at most 2.5 digits";

pub(super) const SCENES: [Scenario; 11] = [
    Scenario {
        id: "S16",
        name: "light tip, 1e-3",
        parameters: "2 links, outer mass 1e-3 kg, kp 200 and 100, kd 30 and 12",
        expected: LIGHT,
        slow: false,
        check: || light_outer_link(1e-3),
    },
    Scenario {
        id: "S17",
        name: "light tip, 1e-6",
        parameters: "2 links, outer mass 1e-6 kg, kp 200 and 100, kd 30 and 12",
        expected: LIGHT,
        slow: false,
        check: || light_outer_link(1e-6),
    },
    Scenario {
        id: "S18",
        name: "light tip, 1e-9",
        parameters: "2 links, outer mass 1e-9 kg, kp 200 and 100, kd 30 and 12",
        expected: LIGHT,
        slow: false,
        check: || light_outer_link(1e-9),
    },
    Scenario {
        id: "S19",
        name: "heavy tip, 1e3",
        parameters: "3 links, outer mass 1e3 kg, anywhere",
        expected: HEAVY,
        slow: false,
        check: || heavy_outer_link(1e3),
    },
    Scenario {
        id: "S20",
        name: "heavy tip, 1e6",
        parameters: "3 links, outer mass 1e6 kg, anywhere",
        expected: HEAVY,
        slow: false,
        check: || heavy_outer_link(1e6),
    },
    Scenario {
        id: "S21",
        name: "heavy tip, 1e9",
        parameters: "3 links, outer mass 1e9 kg, anywhere",
        expected: HEAVY,
        slow: false,
        check: || heavy_outer_link(1e9),
    },
    Scenario {
        id: "S22",
        name: "heavy tip, stretched",
        parameters: "3 links, outer mass 1e9 kg, hanging within 1e-6 rad of straight",
        expected: "at most 2.5 digits lost; limits 1.649e-5 s (Runge-Kutta 4) and 1.166e-5 s (Verlet); Runge-Kutta 4 \
                   swings on at 1.6e-5 s and flies apart at 2e-5 s",
        slow: false,
        check: heavy_link_stretched,
    },
    Scenario {
        id: "S23",
        name: "length ratio 1e3 and 1e-3",
        parameters: "3 links, outer length 1e3 m, then 1e-3 m, anywhere",
        expected: "worst of 200 states loses at most 2.5 digits",
        slow: false,
        check: length_ratio,
    },
    Scenario {
        id: "S24",
        name: "stretched",
        parameters: "3 links exactly in line, any direction, rates within 2 rad/s",
        expected: "accelerations finite, at most 2.5 digits lost",
        slow: false,
        check: || in_line([0.0, 0.0, 0.0]),
    },
    Scenario {
        id: "S25",
        name: "folded",
        parameters: "3 links folded back at the double next to π, any direction; default gains",
        expected: "as stretched; and no pose's limit is below the minimum over poses by more than 1 %",
        slow: false,
        check: folded,
    },
    Scenario {
        id: "S26",
        name: "whirl",
        parameters: "2 and 3 links stretched, no gravity, 1000 rad/s",
        expected: "limit of timestep times rate 0.76376 and 0.42370 (Verlet), 1.0801 and 0.59920 (Runge-Kutta 4), to 1 \
                   %, predicted and measured",
        slow: false,
        check: whirl,
    },
];

fn light_outer_link(mass: f64) -> Observation {
    let Some(arm) = arm([1.0, mass], 9.81) else {
        return verdict(false, "no such arm".to_owned());
    };
    let digits = digits_lost(&arm, &states([0.0, 0.0], PI));
    let gains = Gains {
        kp: [200.0, 100.0],
        ki: [0.0; 2],
        kd: [30.0, 12.0],
    };
    let control = ControlLoop {
        arm,
        ..held(gains, [0.5, 0.8])
    };
    let linear = Linear::at_setpoint(&control);
    let predicted = largest_timestep(&linear, Method::Rk4, Sampling::Held);
    let measured =
        predicted.and_then(|limit| measured_limit(&control, Sampling::Held, 0.9 * limit));
    let ratio = measured
        .zip(predicted)
        .map(|(measured, predicted)| measured / predicted);
    let agree = ratio.is_some_and(|ratio| (ratio - 1.0).abs() < 0.01);
    // A rod alone turns about its end with m l²/3; under held damping its limit is 2 inertia / kd.
    let alone = 2.0 * (mass / 3.0) / gains.kd[1];
    let as_light = predicted.is_some_and(|limit| (limit / alone - 1.0).abs() < 0.01);
    verdict(
        digits <= DIGITS && agree && as_light,
        format!(
            "{digits:.1} digits lost; limit predicted {} s, measured {} s",
            short(predicted),
            short(measured)
        ),
    )
}

fn heavy_outer_link(mass: f64) -> Observation {
    let digits = arm([1.0, 1.0, mass], 9.81).map(|arm| digits_lost(&arm, &states([0.0; 3], PI)));
    verdict(
        digits.is_some_and(|digits| digits <= DIGITS),
        digits.map_or_else(String::new, |digits| format!("{digits:.1} digits lost")),
    )
}

fn heavy_link_stretched() -> Observation {
    let Some(arm) = arm([1.0, 1.0, 1e9], 9.81) else {
        return verdict(false, "no such arm".to_owned());
    };
    let digits = digits_lost(&arm, &states([0.0; 3], 1e-6));
    let linear = Linear::at_pose(&ControlLoop::free(arm), &[-FRAC_PI_2, 0.0, 0.0]);
    let limit = |method| largest_timestep(&linear, method, Sampling::Continuous);
    let (rk4, verlet) = (limit(Method::Rk4), limit(Method::Verlet));
    let near = |limit: Option<f64>, expected: f64| {
        limit.is_some_and(|limit| (limit / expected - 1.0).abs() < 0.01)
    };
    let flies = |timestep| {
        let start = State::at_rest([-FRAC_PI_2, 1e-6, -1e-6]);
        let mut simulation = free(arm, start, Method::Rk4, timestep);
        simulation.advance(20_000);
        let fastest = largest(simulation.state().velocity.iter().map(|v| v.abs()));
        // The nudge holds 1e-6 rad of a mode of 1.7e5 rad/s: rates of some 0.2 rad/s.
        simulation.divergence().is_some() || fastest > 10.0
    };
    let (within, beyond) = (flies(1.6e-5), flies(2.0e-5));
    verdict(
        digits <= DIGITS && near(rk4, 1.649e-5) && near(verlet, 1.166e-5) && !within && beyond,
        format!(
            "{digits:.1} digits lost; limits {} and {} s; at 1.6e-5 s it {}, at 2e-5 s it {}",
            short(rk4),
            short(verlet),
            if within { "flies apart" } else { "swings on" },
            if beyond { "flies apart" } else { "swings on" },
        ),
    )
}

fn length_ratio() -> Observation {
    let lost = [1e3, 1e-3].map(|length| {
        Arm::new([1.0, 1.0, length], [1.0; 3], 9.81).map_or(f64::INFINITY, |arm| {
            digits_lost(&arm, &states([0.0; 3], PI))
        })
    });
    verdict(
        lost.iter().all(|&lost| lost <= DIGITS),
        format!(
            "{:.1} digits lost with the long tip, {:.1} with the short one",
            lost[0], lost[1]
        ),
    )
}

fn in_line(pose: [f64; 3]) -> Observation {
    let digits = digits_lost(&Arm::default(), &states(pose, 0.0));
    verdict(
        digits.is_finite() && digits <= DIGITS,
        format!("{digits:.1} digits lost"),
    )
}

fn folded() -> Observation {
    let straight = in_line([0.0, PI, -PI]);
    let control = held(Gains::<3>::default(), [0.0; 3]);
    let smallest = limits(&control).minimum_held;
    let at = |pose: [f64; 3]| {
        let linear = Linear::at_pose(&control, &pose);
        largest_timestep(&linear, Method::Rk4, Sampling::Held).unwrap_or(f64::INFINITY)
    };
    let (stretched, folded) = (at([0.0; 3]), at([0.0, PI, -PI]));
    // Poses between those of the grid.
    let anywhere = states([0.0; 3], PI)
        .iter()
        .take(50)
        .map(|state| at(state.position))
        .fold(f64::INFINITY, f64::min);
    let least = stretched.min(folded).min(anywhere);
    let covers = smallest.is_some_and(|smallest| least > 0.99 * smallest);
    verdict(
        straight.holds && covers,
        format!(
            "{}; limit folded {folded:.4e} s, stretched {stretched:.4e} s, least of 50 others {anywhere:.4e} s, \
             minimum over poses {} s",
            straight.observed,
            short(smallest)
        ),
    )
}

fn whirl() -> Observation {
    let mut holds = true;
    let mut observed = vec![];
    let mut judge = |limits: [(Method, f64, Option<f64>, Option<f64>); 2]| {
        for (method, expected, predicted, measured) in limits {
            for limit in [predicted, measured] {
                holds &= limit.is_some_and(|limit| (limit / expected - 1.0).abs() < 0.01);
            }
            observed.push(format!(
                "{method} {} (measured {})",
                short(predicted),
                short(measured)
            ));
        }
    };
    judge(whirl_limits::<2>([0.76376, 1.0801]));
    judge(whirl_limits::<3>([0.42370, 0.59920]));
    verdict(holds, observed.join(", "))
}

/// Timestep times rate: expected, predicted from the fastest mode of the whirling arm, measured.
fn whirl_limits<const N: usize>(
    expected: [f64; 2],
) -> [(Method, f64, Option<f64>, Option<f64>); 2] {
    const RATE: f64 = 1000.0;
    let [verlet, rk4] = expected;
    let methods = [
        (Method::Verlet, verlet, 2.0),
        (Method::Rk4, rk4, 8.0_f64.sqrt()),
    ];
    methods.map(|(method, expected, reach)| {
        let Some(arm) = arm([1.0; N], 0.0) else {
            return (method, expected, None, None);
        };
        let mut start = State::rest();
        start.velocity[0] = RATE;
        let fastest = largest(
            jacobian(&arm, &start)
                .eigenvalues()
                .iter()
                .map(|m| m.modulus()),
        );
        let mut nudged = start;
        nudged.position[1] = 1e-9;
        let measured = boundary(0.9 * expected, |angle| {
            let mut simulation = free(arm, nudged, method, angle / RATE);
            // At any time: past its limit Runge-Kutta 4 takes spin away until it is within again.
            (0..400).all(|_| {
                simulation.advance(10);
                let angles = simulation.state().position;
                angles.iter().skip(1).all(|q| q.abs() < 1e-6)
            })
        });
        (method, expected, Some(reach * RATE / fastest), measured)
    })
}

/// The rates of the motion about a whirl, by central differences: positions and velocities of the joints.
fn jacobian<const N: usize>(arm: &Arm<N>, state: &State<N>) -> Matrix {
    let acceleration = |column: usize, off: f64| {
        let mut state = *state;
        // Rates are differenced at their own scale.
        if column < N {
            state.position[column] += off;
        } else {
            state.velocity[column - N] += 1000.0 * off;
        }
        forward_dynamics(arm, &state.position, &state.velocity, &[0.0; N])
    };
    let mut jacobian = Matrix::zeros(2 * N);
    for i in 0..N {
        jacobian[(i, N + i)] = 1.0;
    }
    for column in 0..2 * N {
        let off = 1e-5;
        let (above, below) = (acceleration(column, off), acceleration(column, -off));
        let scale = if column < N { 2.0 * off } else { 2000.0 * off };
        for i in 0..N {
            jacobian[(N + i, column)] = (above[i] - below[i]) / scale;
        }
    }
    jacobian
}
