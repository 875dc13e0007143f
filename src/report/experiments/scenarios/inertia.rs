//! S16 to S26: light and heavy outer links, short and long links, stretched, folded, whirling.
//!
//! **Invariant:** accelerations are compared with ones in twice the digits, measured limits with predicted ones.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, PI};

use super::control::MODERATE;
use super::support::{
    Named, Observation, arm, digits_lost, each, fastest, free, held, is_near, short, states,
};
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

/// The checks of S16 to S26.
pub(super) const CHECKS: [Named; 11] = [
    ("S16", || light_outer_link(1e-3)),
    ("S17", || light_outer_link(1e-6)),
    ("S18", || light_outer_link(1e-9)),
    ("S19", || heavy_outer_link(1e3)),
    ("S20", || heavy_outer_link(1e6)),
    ("S21", || heavy_outer_link(1e9)),
    ("S22", heavy_link_stretched),
    ("S23", || each([1e3, 1e-3].map(long_outer_link))),
    ("S24", || each([loses_few(&Arm::default(), [0.0; 3], 0.0)])),
    ("S25", folded),
    ("S26", || {
        each(
            [
                whirl::<2>([0.76376, 1.0801]),
                whirl::<3>([0.42370, 0.59920]),
            ]
            .concat(),
        )
    }),
];

/// Whether an arm loses few digits around a pose, and how many.
fn loses_few<const N: usize>(arm: &Arm<N>, pose: [f64; N], spread: f64) -> (bool, String) {
    let digits = digits_lost(arm, &states(pose, spread));
    (digits <= DIGITS, format!("{digits:.1} digits lost"))
}

fn light_outer_link(mass: f64) -> Observation {
    let control = ControlLoop {
        arm: arm([1.0, mass], 9.81),
        ..held(MODERATE, [0.5, 0.8])
    };
    let linear = Linear::at_setpoint(&control);
    let predicted = largest_timestep(&linear, Method::Rk4, Sampling::Held);
    let limit = predicted.unwrap_or(f64::NAN);
    let measured = measured_limit(&control, Sampling::Held, 0.9 * limit);
    // A rod alone turns about its end with m l²/3; under held damping its limit is 2 inertia / kd.
    let alone = 2.0 * (mass / 3.0) / MODERATE.kd[1];
    let holds = is_near(measured, limit, 0.01) && is_near(predicted, alone, 0.01);
    let limits = format!(
        "limit predicted {} s, measured {} s",
        short(predicted),
        short(measured)
    );
    each([loses_few(&control.arm, [0.0; 2], PI), (holds, limits)])
}

fn heavy_outer_link(mass: f64) -> Observation {
    each([loses_few(&arm([1.0, 1.0, mass], 9.81), [0.0; 3], PI)])
}

fn long_outer_link(length: f64) -> (bool, String) {
    let arm = Arm::new([1.0, 1.0, length], [1.0; 3], 9.81).unwrap_or_default();
    let (holds, words) = loses_few(&arm, [0.0; 3], PI);
    (holds, format!("{words} with a tip of {length} m"))
}

fn heavy_link_stretched() -> Observation {
    let arm = arm([1.0, 1.0, 1e9], 9.81);
    let linear = Linear::at_pose(&ControlLoop::free(arm), &[-FRAC_PI_2, 0.0, 0.0]);
    let limits = [(Method::Rk4, 1.649e-5), (Method::Verlet, 1.166e-5)].map(|(method, expected)| {
        let limit = largest_timestep(&linear, method, Sampling::Continuous);
        (
            is_near(limit, expected, 0.01),
            format!("{method} limit {} s", short(limit)),
        )
    });
    let swings = [(1.6e-5, false), (2.0e-5, true)].map(|(timestep, is_apart)| {
        let start = State::at_rest([-FRAC_PI_2, 1e-6, -1e-6]);
        let mut simulation = free(arm, start, Method::Rk4, timestep);
        simulation.advance(20_000);
        // The nudge holds 1e-6 rad of a mode of 1.7e5 rad/s: rates of some 0.2 rad/s.
        let flies = simulation.divergence().is_some() || fastest(&simulation) > 10.0;
        let words = if flies { "flies apart" } else { "swings on" };
        (flies == is_apart, format!("at {timestep:e} s it {words}"))
    });
    let digits = loses_few(&arm, [0.0; 3], 1e-6);
    each([digits].into_iter().chain(limits).chain(swings))
}

fn folded() -> Observation {
    let control = held(Gains::<3>::default(), [0.0; 3]);
    let smallest = limits(&control).minimum_held;
    let at = |pose: [f64; 3]| {
        let linear = Linear::at_pose(&control, &pose);
        largest_timestep(&linear, Method::Rk4, Sampling::Held).unwrap_or(f64::INFINITY)
    };
    let (stretched, folded) = (at([0.0; 3]), at([0.0, PI, -PI]));
    // Poses between those of the grid.
    let others = states([0.0; 3], PI).into_iter().take(50);
    let anywhere = others
        .map(|state| at(state.position))
        .fold(f64::INFINITY, f64::min);
    let least = stretched.min(folded).min(anywhere);
    let covers = smallest.is_some_and(|smallest| least > 0.99 * smallest);
    let words = format!(
        "limit folded {folded:.4e} s, stretched {stretched:.4e} s, least of 50 others {anywhere:.4e} s, minimum over \
         poses {} s",
        short(smallest)
    );
    each([
        loses_few(&Arm::default(), [0.0, PI, -PI], 0.0),
        (covers, words),
    ])
}

/// Limits of Verlet and Runge-Kutta 4 as timestep times rate: predicted from the fastest mode of the whirling arm, and
/// measured.
fn whirl<const N: usize>([verlet, rk4]: [f64; 2]) -> [(bool, String); 2] {
    const RATE: f64 = 1000.0;
    let methods = [
        (Method::Verlet, verlet, 2.0),
        (Method::Rk4, rk4, 8.0_f64.sqrt()),
    ];
    methods.map(|(method, expected, reach)| {
        let arm = arm([1.0; N], 0.0);
        let mut start = State::rest();
        start.velocity[0] = RATE;
        let modes = jacobian(&arm, &start).eigenvalues();
        let predicted = reach * RATE / largest(modes.iter().map(|mode| mode.modulus()));
        start.position[1] = 1e-9;
        let measured = boundary(0.9 * expected, |angle| {
            let mut simulation = free(arm, start, method, angle / RATE);
            // At any time: past its limit Runge-Kutta 4 takes spin away until it is within again.
            (0..400).all(|_| {
                simulation.advance(10);
                let angles = simulation.state().position;
                angles.iter().skip(1).all(|q| q.abs() < 1e-6)
            })
        });
        let both = [Some(predicted), measured];
        let holds = both.iter().all(|limit| is_near(*limit, expected, 0.01));
        (
            holds,
            format!("{method} {predicted:.4e} (measured {})", short(measured)),
        )
    })
}

/// The rates of the motion about a whirl, by central differences: positions and velocities of the joints.
fn jacobian<const N: usize>(arm: &Arm<N>, state: &State<N>) -> Matrix {
    const OFF: f64 = 1e-5;
    // Rates are differenced at their own scale.
    let scale = |column: usize| if column < N { OFF } else { 1000.0 * OFF };
    let acceleration = |column: usize, side: f64| {
        let State {
            mut position,
            mut velocity,
        } = *state;
        let values = if column < N {
            &mut position
        } else {
            &mut velocity
        };
        values[column % N] += side * scale(column);
        forward_dynamics(arm, &position, &velocity, &[0.0; N])
    };
    let columns: Vec<_> = (0..2 * N)
        .map(|column| (acceleration(column, 1.0), acceleration(column, -1.0)))
        .collect();
    Matrix::from_fn(2 * N, |row, column| {
        if row < N {
            return f64::from(u8::from(column == N + row));
        }
        let (above, below) = &columns[column];
        (above[row - N] - below[row - N]) / (2.0 * scale(column))
    })
}
