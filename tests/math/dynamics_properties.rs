//! The equation of motion on any ordinary arm: against a Lagrangian differentiated numerically, and against itself.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{
    coriolis, energy, forward_dynamics, gravity_load, inverse_dynamics, mass_matrix, textbook,
    weightless_dynamics,
};
use proptest::array::uniform;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use std::fmt::Debug;
use std::hint::black_box;

/// Half the distance from 1 to the next number: the relative error of one rounding.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

/// Runs a check that is generic in the number of links for 1 to 6 of them.
macro_rules! for_one_to_six_links {
    ($check:ident) => {
        $check::<1>();
        $check::<2>();
        $check::<3>();
        $check::<4>();
        $check::<5>();
        $check::<6>();
    };
}

/// An ordinary arm in ordinary motion, and efforts.
#[derive(Debug, Clone)]
struct Motion<const N: usize> {
    arm: Arm<N>,
    q: [f64; N],
    qd: [f64; N],
    tau: [f64; N],
}

fn motion<const N: usize>() -> impl Strategy<Value = Motion<N>> {
    let rod = || uniform::<_, N>(0.2..3.0);
    let each = |bound: f64| uniform::<_, N>(-bound..bound);
    (rod(), rod(), 0.0..20.0, each(7.0), each(3.0), each(30.0)).prop_map(
        |(lengths, masses, gravity, q, qd, tau)| {
            let arm = Arm::new(lengths, masses, gravity).unwrap();
            Motion { arm, q, qd, tau }
        },
    )
}

type Check<'a, T> = &'a dyn Fn(T) -> Result<(), TestCaseError>;

/// The runner is large: it is compiled for each type of value, not for each check.
fn for_any<T: Debug>(strategy: impl Strategy<Value = T> + 'static, check: Check<'_, T>) {
    let config = ProptestConfig {
        source_file: Some(file!()),
        ..ProptestConfig::default()
    };
    TestRunner::new(config)
        .run(&strategy.boxed(), check)
        .unwrap();
}

/// Every element within `relative` of the largest magnitude that went into it.
fn close(got: &[f64], want: &[f64], scale: f64, relative: f64) -> Result<(), TestCaseError> {
    for (got, want) in got.iter().zip(want) {
        let bound = relative * scale;
        prop_assert!(
            (got - want).abs() <= bound,
            "got {got}, want {want}, bound {bound}"
        );
    }
    Ok(())
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, value| m.max(value.abs()))
}

/// Kinetic and potential energy the long way: two-point Gauss quadrature along each rod, exact since the squared speed is
/// quadratic and the height linear along it. Angles are summed, velocities differentiated by hand, nothing is shared with the library.
fn quadrature<const N: usize>(arm: &Arm<N>, q: &[f64; N], qd: &[f64; N]) -> (f64, f64) {
    let (mut x, mut y, mut vx, mut vy, mut angle, mut rate) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut kinetic, mut potential) = (0.0, 0.0);
    for i in 0..N {
        angle += q[i];
        rate += qd[i];
        let at = |s: f64| {
            let (sin, cos) = f64::sin_cos(angle);
            (
                x + s * cos,
                y + s * sin,
                vx - s * sin * rate,
                vy + s * cos * rate,
            )
        };
        let (length, mass) = (arm.lengths()[i], arm.masses()[i]);
        for side in [-1.0, 1.0] {
            let (_, height, along_x, along_y) = at(0.5 * length * (1.0 + side / 3.0_f64.sqrt()));
            kinetic += 0.25 * mass * (along_x * along_x + along_y * along_y);
            potential += 0.5 * mass * arm.gravity() * height;
        }
        (x, y, vx, vy) = at(length);
    }
    (kinetic, potential)
}

fn unit<const N: usize>(i: usize, size: f64) -> [f64; N] {
    std::array::from_fn(|k| if k == i { size } else { 0.0 })
}

fn plus<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Central difference of fourth order: its error is of the order of `step⁴`, and `ROUND_OFF / step` from rounding.
fn slope(f: impl Fn(f64) -> f64, step: f64) -> f64 {
    (8.0 * (f(step) - f(-step)) - (f(2.0 * step) - f(-2.0 * step))) / (12.0 * step)
}

#[test]
fn the_terms_are_those_of_the_lagrangian() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, qd, .. }| {
            let kinetic = |q: &[f64; N], qd: &[f64; N]| quadrature(&arm, q, qd).0;
            // ∂T/∂q̇_i, exact but for rounding: T is quadratic in q̇.
            let momentum = |q: &[f64; N], i: usize| {
                0.5 * (kinetic(q, &plus(&qd, &unit(i, 1.0)))
                    - kinetic(q, &plus(&qd, &unit(i, -1.0))))
            };
            let step = 2e-3; // step⁴ = 1.6e-11, ROUND_OFF / step = 6e-14
            for i in 0..N {
                let row: [f64; N] = std::array::from_fn(|j| {
                    let both = kinetic(&q, &plus(&unit(i, 1.0), &unit(j, 1.0)));
                    both - kinetic(&q, &unit(i, 1.0)) - kinetic(&q, &unit(j, 1.0))
                });
                let m = mass_matrix(&arm, &q);
                close(&m[i], &row, largest(m.as_flattened()), 1e-13)?;

                let load = slope(|h| quadrature(&arm, &plus(&q, &unit(i, h)), &qd).1, step);
                let weight = arm.gravity() * arm.reach() * arm.masses().iter().sum::<f64>();
                close(&[gravity_load(&arm, &q)[i]], &[load], weight, 1e-9)?;

                // d/dt ∂T/∂q̇ - ∂T/∂q with q̈ = 0.
                let moved = |h: f64| std::array::from_fn(|k| q[k] + h * qd[k]);
                let rate = slope(|h| momentum(&moved(h), i), step);
                let force = slope(|h| kinetic(&plus(&q, &unit(i, h)), &qd), step);
                let speed = (N as f64 * 3.0).powi(2);
                let inertia = arm.reach().powi(2) * arm.masses().iter().sum::<f64>();
                close(
                    &[coriolis(&arm, &q, &qd)[i]],
                    &[rate - force],
                    inertia * speed,
                    1e-7,
                )?;
            }
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn inverse_dynamics_are_the_sum_of_the_three_terms() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion {
                                     arm,
                                     q,
                                     qd,
                                     tau: qdd,
                                 }| {
            let (m, c, g) = (
                mass_matrix(&arm, &q),
                coriolis(&arm, &q, &qd),
                gravity_load(&arm, &q),
            );
            let sum: [f64; N] = std::array::from_fn(|i| {
                (0..N).map(|j| m[i][j] * qdd[j]).sum::<f64>() + c[i] + g[i]
            });
            let scale = largest(m.as_flattened()) * largest(&qdd) + largest(&c) + largest(&g);
            // Some 2 n² terms are summed in another order.
            close(&inverse_dynamics(&arm, &q, &qd, &qdd), &sum, scale, 1e-13)
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn inverse_dynamics_give_back_the_effort_of_forward_dynamics() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, qd, tau }| {
            let qdd = forward_dynamics(&arm, &q, &qd, &tau);
            let back = inverse_dynamics(&arm, &q, &qd, &qdd);
            // Two and a half digits of `qdd` may be gone (see above), which the largest inertia brings into the effort.
            let scale = largest(mass_matrix(&arm, &q).as_flattened()) * largest(&qdd) * N as f64;
            close(&back, &tau, scale + largest(&tau), 316.0 * ROUND_OFF)
        });
    }
    for_one_to_six_links!(check);
}

/// Both ways to the accelerations belong to the same effort; apart they may be by what an ill-conditioned M hides.
#[test]
fn the_line_of_the_book_and_the_recursion_agree() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, qd, tau }| {
            let (m, book) = (mass_matrix(&arm, &q), textbook(&arm, &q, &qd, &tau));
            let recursion = forward_dynamics(&arm, &q, &qd, &tau);
            let effort =
                |qdd: &[f64; N]| m.map(|row| row.iter().zip(qdd).map(|(m, a)| m * a).sum());
            let (one, other): ([f64; N], [f64; N]) = (effort(&book), effort(&recursion));
            let scale = largest(m.as_flattened()) * largest(&recursion).max(largest(&book));
            close(
                &one,
                &other,
                N as f64 * scale + largest(&tau),
                316.0 * ROUND_OFF,
            )
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_mass_matrix_is_symmetric_and_positive_definite() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, .. }| {
            let m = mass_matrix(&arm, &q);
            // Cholesky: all pivots positive, of a matrix that equals its transpose bit for bit.
            let mut l = [[0.0_f64; N]; N];
            for i in 0..N {
                for j in 0..=i {
                    prop_assert_eq!(m[i][j].to_bits(), m[j][i].to_bits());
                    let rest = m[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
                    prop_assert!(i != j || rest > 0.0, "pivot {i} is {rest}");
                    l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
                }
            }
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_energy_grows_by_the_power_of_the_efforts() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, qd, tau }| {
            let qdd = forward_dynamics(&arm, &q, &qd, &tau);
            // Along any path that starts with these rates and accelerations, dE/dt = τ · q̇.
            let after = |h: f64| State {
                position: std::array::from_fn(|i| q[i] + h * qd[i]),
                velocity: std::array::from_fn(|i| qd[i] + h * qdd[i]),
            };
            let fastest = 1.0 + largest(&qd) * N as f64;
            let quickest = fastest + largest(&qdd).sqrt() * N as f64;
            // Errors: (rate × step)⁴ from the difference, ROUND_OFF / (rate × step) from rounding; equal near 1e-3.
            let step = 1e-3 / quickest;
            let growth = slope(|h| energy(&arm, &after(h)), step);
            let power: f64 = (0..N).map(|i| tau[i] * qd[i]).sum();
            let mass: f64 = arm.masses().iter().sum();
            let scale = mass * arm.reach().powi(2) * quickest.powi(3)
                + mass * arm.gravity() * arm.reach() * quickest;
            close(&[growth], &[power], scale, 1e-10)
        });
    }
    for_one_to_six_links!(check);
}

// Changes that must not matter

/// One joint wound up by 1e8 rad and the same joint at the angle that has that sine and cosine: the accelerations differ by what
/// rounding that angle (2e-16 of at most π) does to them, which is far less than the 1e-8 rad that a sum of angles would be off.
#[test]
fn a_wound_joint_moves_like_an_unwound_one() {
    fn check<const N: usize>() {
        for_any((motion::<N>(), 0..N, -1e8..1e8_f64), &|(
            motion,
            joint,
            angle,
        )| {
            let Motion {
                arm,
                mut q,
                qd,
                tau,
            } = motion;
            q[joint] = angle;
            let wound = forward_dynamics(&arm, &q, &qd, &tau);
            q[joint] = f64::atan2(angle.sin(), angle.cos());
            let unwound = forward_dynamics(&arm, &q, &qd, &tau);
            // The rest of the scale is how strongly accelerations depend on an angle: up to the conditioning of the arm.
            let scale = largest(&wound) + largest(&qd).powi(2) + arm.gravity() + largest(&tau);
            close(&wound, &unwound, scale, 1e-10)
        });
    }
    for_one_to_six_links!(check);
}

/// The first angle says how the arm lies in the field of gravity, and nothing else.
#[test]
fn without_gravity_the_first_angle_changes_no_bit() {
    fn check<const N: usize>() {
        for_any((motion::<N>(), -1e9..1e9_f64), &|(motion, first)| {
            let Motion {
                arm,
                mut q,
                qd,
                tau,
            } = motion;
            let arm = Arm::new(*arm.lengths(), *arm.masses(), 0.0).unwrap();
            let before = forward_dynamics(&arm, &q, &qd, &tau);
            q[0] = first;
            let after = forward_dynamics(&arm, &q, &qd, &tau);
            prop_assert_eq!(before.map(f64::to_bits), after.map(f64::to_bits));
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn leaving_out_the_first_angle_changes_no_bit() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, qd, tau }| {
            let arm = Arm::new(*arm.lengths(), *arm.masses(), 0.0).unwrap();
            let whole = forward_dynamics(&arm, &q, &qd, &tau);
            let less = weightless_dynamics(&arm, &q, &qd, &tau);
            prop_assert_eq!(whole.map(f64::to_bits), less.map(f64::to_bits));
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn without_gravity_and_effort_a_resting_arm_stays_at_rest() {
    fn check<const N: usize>() {
        for_any(motion::<N>(), &|Motion { arm, q, .. }| {
            let arm = Arm::new(*arm.lengths(), *arm.masses(), 0.0).unwrap();
            let qdd = forward_dynamics(&arm, &q, &[0.0; N], &[0.0; N]);
            prop_assert!(qdd.iter().all(|a| *a == 0.0), "{qdd:?}");
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_arm_let_go_from_its_starting_pose_falls() {
    fn check<const N: usize>() {
        let arm = Arm::<N>::default();
        let State { position, velocity } = State::rest();
        let qdd = forward_dynamics(&arm, &position, &velocity, &[0.0; N]);
        assert!(qdd.iter().all(|a| a.is_finite()) && qdd[0] < 0.0, "{qdd:?}");
    }
    for_one_to_six_links!(check);
}

/// Any parameter that an arm may have and any finite state: non-finite results are allowed, panics are not.
#[test]
fn extreme_but_valid_input_never_panics() {
    fn check<const N: usize>() {
        let positive = || uniform::<_, N>((-307.0..308.0).prop_map(|e: f64| 10_f64.powf(e)));
        let any = || uniform::<_, N>(proptest::num::f64::ANY);
        let input = (positive(), positive(), 0.0..1e300, any(), any(), any());
        for_any(input, &|(lengths, masses, gravity, q, qd, tau)| {
            let arm = Arm::new(lengths, masses, gravity).unwrap();
            let state = State {
                position: q,
                velocity: qd,
            };
            black_box(forward_dynamics(&arm, &q, &qd, &tau));
            black_box(inverse_dynamics(&arm, &q, &qd, &tau));
            black_box((mass_matrix(&arm, &q), energy(&arm, &state)));
            Ok(())
        });
    }
    for_one_to_six_links!(check);
}
