//! Arms of which some joints have no gains: no limit is found where nothing grows.
//!
//! The other routine: the step matrix in twice the digits, squared again and again. The norm of its powers grows like a
//! polynomial if all eigenvalues are within the unit circle, a double 1 included, and exponentially otherwise.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::{Method, increment};
use pendularm::math::pid::Setpoint;
use pendularm::report::experiments::reference::DoubleDouble;
use pendularm::study::control_loop::{ControlLoop, no_control};
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::stability::limits;

use super::{Dice, Tally, cases, property, run};

/// A step's states: positions, velocities and integrals of at most three joints.
const STATES: usize = 9;

type Step = [[DoubleDouble; STATES]; STATES];

/// Squarings: the growth of 2^62 steps shows 2e-16 in one.
const SQUARINGS: u32 = 62;

/// The matrix of one step of `h` \[s\], column by column.
#[allow(
    clippy::needless_range_loop,
    reason = "a column is written into every row"
)]
fn step<const N: usize>(linear: &Linear, method: Method, h: f64) -> Step {
    let exact = DoubleDouble::from;
    let mut matrix = [[DoubleDouble::ZERO; STATES]; STATES];
    for column in 0..3 * N {
        let at = |i: usize| exact(f64::from(u8::from(i == column)));
        let q: [_; N] = std::array::from_fn(at);
        let v: [_; N] = std::array::from_fn(|i| at(N + i));
        let mut integral: [_; N] = std::array::from_fn(|i| at(2 * N + i));
        let mut effort: [_; N] =
            std::array::from_fn(|i| -(exact(linear.kp[i]) * q[i] + exact(linear.kd[i]) * v[i]));
        let mut acts = [false; N];
        for &(joint, ki) in &linear.integrals {
            integral[joint] = integral[joint] - exact(h) * q[joint];
            effort[joint] = effort[joint] + exact(ki) * integral[joint];
            acts[joint] = true;
        }
        let acceleration = |_, q: &[DoubleDouble; N], _: &[DoubleDouble; N]| {
            std::array::from_fn(|i| {
                (0..N).fold(DoubleDouble::ZERO, |sum, j| {
                    sum + exact(linear.inverse_mass[(i, j)]) * effort[j]
                        - exact(linear.gravity[(i, j)]) * q[j]
                })
            })
        };
        let (dq, dv) = increment(method, acceleration, DoubleDouble::ZERO, &q, &v, exact(h));
        for i in 0..N {
            matrix[i][column] = q[i] + dq[i];
            matrix[N + i][column] = v[i] + dv[i];
            if acts[i] {
                matrix[2 * N + i][column] = integral[i];
            }
        }
    }
    matrix
}

/// Whether the powers of a step grow exponentially.
fn grows(mut matrix: Step) -> bool {
    // The binary logarithm of the norm of all steps so far, which the matrix leaves out.
    let mut exponent = 0_i128;
    for _ in 0..SQUARINGS {
        let product = |i: usize, j: usize| {
            (0..STATES).fold(DoubleDouble::ZERO, |sum, k| {
                sum + matrix[i][k] * matrix[k][j]
            })
        };
        matrix = std::array::from_fn(|i| std::array::from_fn(|j| product(i, j)));
        let entries = matrix.iter().flatten().map(|entry| entry.abs().to_f64());
        let norm = entries.fold(0.0, f64::max);
        if norm == 0.0 {
            return false;
        }
        // A power of two, so that scaling is exact.
        let scale = norm.log2().floor();
        exponent = 2 * exponent + scale as i128;
        matrix = matrix.map(|row| row.map(|entry| entry * (-scale).exp2()));
    }
    // A Jordan block of three states grows with the square of the number of steps, 2^124.
    exponent > 1000
}

/// From subsets of the gains to none at all, on uneven links, in weak gravity and strong.
fn control<const N: usize>(dice: &mut Dice) -> ControlLoop<N> {
    let lengths = std::array::from_fn(|_| dice.size(1.0));
    let masses = std::array::from_fn(|_| dice.size(2.0));
    let gravity = match dice.0.u32(0..6) {
        0 => 0.0,
        1 => 1e-3 * dice.size(3.0),
        _ => 30.0 * dice.0.f64(),
    };
    let arm = Arm::<N>::new(lengths, masses, gravity).unwrap();
    let setpoint = Setpoint::at(dice.setpoint());
    let method = Method::ALL[dice.0.usize(0..Method::ALL.len())];
    let mut gains = dice.gains(&arm);
    if dice.one_in(3) {
        gains = no_control();
    } else {
        for gain in [&mut gains.kp, &mut gains.ki, &mut gains.kd]
            .into_iter()
            .flatten()
        {
            if dice.one_in(2) {
                *gain = 0.0;
            }
        }
    }
    ControlLoop::new(arm, gains, setpoint).with_method(method)
}

fn nothing_is_limited_where_nothing_grows<const N: usize>(case: u64, tally: &mut Tally) {
    let control = control::<N>(&mut Dice::of(case));
    let found = limits(&control);
    let rest = equilibrium(&control);
    let at_rest = Linear::at(&control, &rest.position, &rest.integrating);
    let pose = found.worst_pose.unwrap_or(rest.position);
    let there = Linear::at_pose(&control, &pose);
    for (name, limit, linears) in [
        ("held", found.held, vec![at_rest.clone()]),
        (
            "minimum",
            found.minimum_held,
            vec![there.clone().weightless(), there, at_rest],
        ),
    ] {
        let Some(limit) = limit else {
            continue;
        };
        tally.tried += 1;
        let is_justified = linears.iter().any(|linear| {
            let modes = linear.flow().eigenvalues().into_iter();
            let rate = modes
                .map(pendularm::study::matrix::Complex::modulus)
                .fold(0.0, f64::max);
            let timesteps = if limit > 0.0 {
                [1.0001, 1.003, 1.03, 1.1].map(|part| part * limit)
            } else {
                [0.001, 0.01, 0.05, 0.2].map(|part| part / rate)
            };
            rate > 0.0
                && timesteps
                    .into_iter()
                    .any(|h| grows(step::<N>(linear, control.method, h)))
        });
        if !is_justified {
            println!("case {case}: {name} {limit:e}: {control:?} {found:?}");
            tally.outside += 1;
        }
    }
}

#[test]
fn an_arm_without_some_of_its_gains_is_limited_only_where_something_grows() {
    let tally = property!(nothing_is_limited_where_nothing_grows, 200, 1_000_000);
    assert_eq!(tally.outside, 0, "{tally:?}");
    assert!(tally.tried > 0);
}

/// The double eigenvalue of a drifting joint is spread by rounding to 1.2e-6 of the fastest rate.
#[test]
fn a_drifting_joint_beside_a_stiff_one_sets_no_limit() {
    let mut tally = Tally::default();
    nothing_is_limited_where_nothing_grows::<3>(6135, &mut tally);
    assert_eq!((tally.tried, tally.outside), (2, 0));
}

/// Free arms that a search over poses without gravity gave no timestep. A swing of Verlet is stable up to `2/ω`.
#[test]
fn a_free_arm_gets_a_timestep_near_its_limit() {
    for (method, gravity) in [
        (Method::Verlet, 9.81),
        (Method::Rk4, 27.0),
        (Method::Rk4, 5.0),
    ] {
        let (lengths, masses) = match method {
            Method::Verlet => ([0.4, 0.3], [1.0, 1.0]),
            _ => ([1.0, 1.0], [1.0, 1.0]),
        };
        let arm = Arm::new(lengths, masses, gravity).unwrap();
        let found = limits(&ControlLoop::free(arm).with_method(method));
        let held = found.held.unwrap();
        assert!(found.minimum_held > Some(0.9 * held), "{found:?}");
        assert!(found.advised > Some(0.7 * held), "{found:?}");
    }
}
