//! The smallest limit over all poses: what is proven holds against brute force, and what is found is the smallest there
//! is.

use std::f64::consts::PI;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Limits, Sampling, largest_timestep, limit_held, limits};

fn limit_at<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    pose: &[f64; N],
    method: Method,
    sampling: Sampling,
) -> Option<f64> {
    let control = ControlLoop::new(*arm, *gains, Setpoint::default());
    largest_timestep(&Linear::at_pose(&control, pose), method, sampling)
}

fn at_rest<const N: usize>(arm: &Arm<N>, gains: &Gains<N>, method: Method) -> Limits<N> {
    limits(&ControlLoop::new(*arm, *gains, Setpoint::default()).with_method(method))
}

/// Uneven and underdamped: nine poses of the second joint missed the one that limits, by 1.8 times.
#[test]
fn the_smallest_limit_of_an_uneven_arm_is_found_between_the_poses_of_the_grid() {
    let arm = Arm::new([2.6, 0.73], [0.8, 5.6], 0.0).unwrap();
    let gains = Gains {
        kp: [30668.0, 726.0],
        ki: [0.0; 2],
        kd: [68.5, 8.89],
    };
    let found = at_rest(&arm, &gains, Method::Euler);
    let minimum = found.minimum_held.unwrap();
    let there = limit_at(&arm, &gains, &[0.0, 1.767], Method::Euler, Sampling::Held).unwrap();
    assert!(
        minimum <= there && minimum > 0.99 * there,
        "{minimum} {there}"
    );
    assert!((minimum - 2.236e-3).abs() < 5e-6, "{minimum}");
    assert!(found.certified, "{found:?}");
    // At the advised timestep the arm settles in the worst pose, where it wandered off by half a radian.
    let pose = found.worst_pose.unwrap();
    let mut live = Simulation::new(arm, gains);
    live.set_method(Method::Euler);
    live.set_timestep(found.advised.unwrap());
    live.set_setpoint(Setpoint {
        position: pose,
        velocity: [0.0; 2],
    });
    live.set_state(State {
        position: pose.map(|q| q + 1e-3),
        velocity: [0.0; 2],
    });
    live.enable(true);
    live.advance(20_000);
    let off = (0..2).map(|i| (live.state().position[i] - pose[i]).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4);
}

#[test]
fn the_default_arms_are_proven_for_every_method() {
    for method in Method::ALL {
        let two = at_rest(&Arm::<2>::default(), &Gains::default(), method);
        let three = at_rest(&Arm::<3>::default(), &Gains::default(), method);
        println!("{method}: {two:?}\n{three:?}");
        assert!(two.certified && three.certified);
        assert!(two.bound.unwrap() > 0.003 && three.bound.unwrap() > 0.003);
        // Damping limits them: the outermost joint flips at every step.
        for critical in [two.critical.unwrap(), three.critical.unwrap()] {
            assert!(critical.growth_per_step > 1.0, "{critical:?}");
        }
        let flip = 0.5 / (1.1 * two.minimum_held.unwrap());
        assert!((two.critical.unwrap().frequency / flip - 1.0).abs() < 1e-9);
    }
}

/// An arm, gains and a method of any kind: damped or hardly, with integrals or without, weighing or not.
struct Kind {
    damping: f64,
    integrals: bool,
    gravity: f64,
}

fn random<const N: usize>(rng: &mut fastrand::Rng, kind: &Kind) -> (Arm<N>, Gains<N>) {
    let mut size = |decades: f64| 10_f64.powf(decades * (2.0 * rng.f64() - 1.0));
    let lengths: [f64; N] = std::array::from_fn(|_| size(0.5));
    let masses: [f64; N] = std::array::from_fn(|_| size(0.5));
    let arm = Arm::new(lengths, masses, kind.gravity).unwrap();
    let inertia: [f64; N] = std::array::from_fn(|i| {
        let (reach, mass): (f64, f64) = (lengths[i..].iter().sum(), masses[i..].iter().sum());
        mass * reach * reach / 3.0
    });
    let pace = 30.0 * size(0.3);
    let kp: [f64; N] = std::array::from_fn(|i| inertia[i] * pace * pace * size(0.3));
    let kd = std::array::from_fn(|i| 2.0 * kind.damping * (kp[i] * inertia[i]).sqrt() * size(0.3));
    let ki = if kind.integrals {
        kp.map(|kp| kp * size(0.2))
    } else {
        [0.0; N]
    };
    (arm, Gains { kp, ki, kd })
}

/// Nothing that is proven is refuted, and nothing that is found is undercut, by poses drawn at random.
fn check<const N: usize>(seed: u64, kind: &Kind, cases: usize, poses: usize) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut certified, mut undercut, mut worst) = (0, 0, 1.0_f64);
    for case in 0..cases {
        let (arm, gains) = random::<N>(&mut rng, kind);
        let method = Method::ALL[case % 4];
        let found = at_rest(&arm, &gains, method);
        let told = format!("seed {seed} case {case} {method} {arm:?} {gains:?}");
        let minimum = found.minimum_held.unwrap();
        certified += usize::from(found.certified);
        if let Some(bound) = found.bound {
            // A limit counts growth of 1e-11, which may be a hair before the bound or behind it.
            assert!(bound <= 1.0001 * minimum, "{told}: {bound} {minimum}");
        }
        if minimum > 0.0 {
            let critical = found.critical.expect(&told);
            assert!(
                critical.joint < N && critical.growth_per_step > 1.0,
                "{told} {critical:?}"
            );
            assert!(
                critical.frequency <= 0.5 / (1.1 * minimum) * 1.000_001,
                "{told}"
            );
        }
        for _ in 0..poses {
            let pose = std::array::from_fn(|_| PI * (2.0 * rng.f64() - 1.0));
            let here =
                limit_at(&arm, &gains, &pose, method, Sampling::Held).unwrap_or(f64::INFINITY);
            if let Some(bound) = found.bound {
                assert!(
                    here >= 0.9999 * bound,
                    "{told} {pose:?}: {here} under {bound}"
                );
            }
            if here < 0.99 * minimum {
                worst = worst.max(minimum / here);
                undercut += 1;
                println!(
                    "{told} {pose:?}: {here} for {minimum}, certified {}",
                    found.certified
                );
                assert!(!found.certified, "{told}");
            }
        }
    }
    println!(
        "{N} links, damping {}: {certified} of {cases} certified, {undercut} poses below, by {worst} at most",
        kind.damping
    );
    assert_eq!(undercut, 0);
}

const fn kind(damping: f64, integrals: bool, gravity: f64) -> Kind {
    Kind {
        damping,
        integrals,
        gravity,
    }
}

#[test]
fn no_pose_of_a_damped_two_link_arm_is_worse_than_the_worst() {
    check::<2>(21, &kind(1.5, false, 0.0), 48, 20);
    check::<2>(22, &kind(1.5, true, 9.81), 48, 20);
}

#[test]
fn no_pose_of_an_underdamped_two_link_arm_is_worse_than_the_worst() {
    check::<2>(23, &kind(0.1, false, 0.0), 80, 20);
    check::<2>(24, &kind(0.1, true, 9.81), 16, 20);
}

#[test]
fn no_pose_of_a_three_link_arm_is_worse_than_the_worst() {
    check::<3>(25, &kind(1.5, false, 0.0), 16, 20);
    check::<3>(26, &kind(1.5, true, 9.81), 8, 20);
    check::<3>(27, &kind(0.2, false, 0.0), 8, 30);
}

/// Beside the fastest rate of 1e12/s everything slow seems to grow, as far as rounding knows; these loops are limited
/// by the one joint, `kd h < 2 / max (Kd½ M⁻¹ Kd½)`, and nothing else.
#[test]
fn limits_of_a_billionth_of_a_second_are_told() {
    for kd in [1e9, 1e11, 1e13] {
        let gains = Gains {
            kp: [100.0; 2],
            ki: [0.0; 2],
            kd: [20.0, kd],
        };
        let arm = Arm::<2>::default();
        let setpoint = Setpoint::default();
        let control = ControlLoop::new(arm, gains, setpoint);
        let found = limits(&control);
        // Stretched, (M⁻¹)₂₂ = 96 / 7.
        let expected = 2.0 * 7.0 / 96.0 / kd;
        let held = found.held.unwrap();
        assert!(
            (held / expected - 1.0).abs() < 0.02,
            "{kd:e}: {held:e} for {expected:e}"
        );
        assert_eq!(limit_held(&control), found.held);
        assert!(found.certified, "{kd:e}: {found:?}");
    }
}
