//! The report's experiments: rounding, forcing, stiffness, large motions. Each does what theory says it must.

use std::f64::consts::FRAC_PI_2;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::simulation::state_after;
use pendularm::report::experiments::conditioning::{PoseShape, digits_lost};
use pendularm::report::experiments::forcing::{COARSEST, DURATION, FORCES};
use pendularm::report::experiments::moving::{LookedAt, MovingScene, distance_behind};
use pendularm::report::experiments::nonlinear::{
    PeriodicSwing, are_carried, arrive, move_of, spun,
};
use pendularm::report::experiments::rounding::{Adding, energy_error, law};
use pendularm::report::experiments::stiff::{By, Solver, StiffScene};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Sampling, step_matrix};

/// Slope of the least-squares line through the logarithms.
fn slope(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let along: f64 = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    along / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// A quarter of a million steps of a swing whose truncation error is out of sight.
#[test]
fn carried_rounding_hardly_moves_energy_and_plain_sums_walk() {
    let energy = |adding| energy_error(Method::Rk4, 2e-5, 1 << 18, adding);
    let (carried, plain) = (energy(Adding::Compensated), energy(Adding::Plain));
    let end = |points: &[(f64, f64)]| points.last().unwrap().1;
    assert!(
        end(&plain) > 5.0 * end(&carried),
        "{} {}",
        end(&plain),
        end(&carried)
    );
    // A random walk has 1/2; a decade of one is off by some tenths, and no two decades agree.
    let (least, most) = law(&plain).unwrap();
    assert!(0.0 <= least && least < most && most < 1.5, "{least} {most}");
}

#[test]
fn forces_leave_a_method_the_order_that_theory_says() {
    for force in &FORCES {
        for method in Method::ALL {
            // Steps so short that a period of the fastest force has many, and the error still stands out from rounding.
            let points: Vec<(f64, f64)> = (6..12)
                .map(|halving| {
                    let steps = COARSEST << halving;
                    let error = force.error(method, steps).unwrap();
                    (DURATION / steps as f64, error)
                })
                .filter(|point| point.1 > 1e-13)
                .collect();
            if points.len() < 3 {
                // Order 4 under a smooth force: at rounding already.
                assert_eq!((method, force.name), (Method::Rk4, "smooth"));
                continue;
            }
            let order = slope(&points);
            let expected = f64::from((force.order)(method));
            assert!(
                (order - expected).abs() < 0.3,
                "{} {method}: {order} for {expected}",
                force.name
            );
        }
    }
}

/// Halving the timestep divides the error by two to the order, and holding anything leaves the first.
#[test]
fn a_setpoint_that_moves_and_is_held_for_the_step_leaves_order_one() {
    let scene = MovingScene::new();
    assert!(scene.uncertainty() < 1e-22, "{:e}", scene.uncertainty());
    for behind in LookedAt::ALL {
        for method in Method::ALL {
            let error = |steps| scene.error(behind, method, steps);
            let seen = (error(1 << 11) / error(1 << 12)).log2();
            let expected = f64::from(behind.order(method));
            assert!(
                (seen - expected).abs() < 0.15,
                "{} {method}: {seen} for {expected}",
                behind.name()
            );
        }
    }
}

/// Without velocities damping holds the arm back; the more seldom the setpoint moves, the further behind the arm is.
#[test]
fn velocities_keep_an_arm_near_a_setpoint_that_moves() {
    for every in [1, 17, 100] {
        let (with, without) = (distance_behind(every, true), distance_behind(every, false));
        assert!(1.5 * with < without, "every {every}: {with}, {without}");
    }
    assert!(distance_behind(100, true) > 2.0 * distance_behind(1, true));
}

/// Orders where nothing is stiff, and an error that hardly knows how stiff it is.
#[test]
fn implicit_baselines_have_their_orders_and_do_not_see_stiffness() {
    let soft = StiffScene::new(By::Gains, 1.0);
    assert!((soft.ratio - 1.0).abs() < 1e-9, "{}", soft.ratio);
    for (solver, order) in [(Solver::ImplicitMidpoint, 2.0), (Solver::Rodas3, 3.0)] {
        let error = |steps| soft.run(solver, steps).error;
        let seen = (error(512) / error(1024)).log2();
        assert!((seen - order).abs() < 0.2, "{}: {seen}", solver.name());
    }
    for by in [By::Gains, By::Masses] {
        let stiff = StiffScene::new(by, 1e6);
        assert!(stiff.ratio > 1e5 && stiff.uncertainty < 1e-6, "{stiff:?}");
        for solver in [Solver::ImplicitMidpoint, Solver::Rodas3] {
            let run = stiff.run(solver, 512);
            assert!(run.error < 1e-3, "{} {run:?}", solver.name());
        }
        // The explicit ones have to follow the elbow's rate.
        for method in Method::ALL {
            let solver = Solver::Explicit(method);
            assert!(stiff.fewest_stable_steps(solver).unwrap() > 1e5);
            let error = stiff.run(solver, 4096).error;
            assert!(error.is_nan() || error >= 1e-2, "{method}: {error}");
        }
    }
}

#[test]
fn a_periodic_swing_comes_back() {
    for amplitude in [0.3, 0.6, 1.2] {
        let swing = PeriodicSwing::of(amplitude).unwrap();
        let steps = 20_000;
        let h = swing.period / f64::from(steps);
        let mut state = swing.start;
        for _ in 0..steps {
            let arm = Arm::<2>::default();
            state = state_after(&arm, Method::Rk4, &state, &[0.0; 2], h);
        }
        let State { position, velocity } = state;
        for i in 0..2 {
            // An unstable swing magnifies what rounding leaves of its start.
            let off = (position[i] - swing.start.position[i]).abs();
            assert!(off < 1e-8 && velocity[i].abs() < 1e-7, "{amplitude}: {off}");
        }
    }
}

/// A swing that is hardly one is the linear one: its multipliers are powers of the eigenvalues of a step.
#[test]
fn the_multipliers_of_a_small_swing_are_those_of_its_linearisation() {
    let swing = PeriodicSwing::of(1e-3).unwrap();
    let free = ControlLoop::free(Arm::<2>::default());
    let linear = Linear::at(&free, &[-FRAC_PI_2, 0.0], &[false; 2]);
    for method in Method::ALL {
        let steps = 64;
        let h = swing.period / f64::from(steps);
        let step = step_matrix(&linear, method, Sampling::Continuous, h);
        // The faster of the two modes is the one beside the swing.
        let expected = step
            .eigenvalues()
            .iter()
            .max_by(|a, b| a.im.abs().total_cmp(&b.im.abs()))
            .unwrap()
            .modulus()
            .powi(64);
        let seen = swing.transverse(method, steps);
        assert!(
            (seen / expected - 1.0).abs() < 1e-3,
            "{method}: {seen} for {expected}"
        );
    }
}

#[test]
fn moves_and_swings_are_lost_at_long_steps_only() {
    for method in Method::ALL {
        let moves = [1e-3, 1.5e-2].map(|h| move_of(1.0, method, h));
        assert_eq!(arrive(&moves), [true, false], "{method}");
        let free = ControlLoop::free(Arm::default()).with_method(method);
        let swings =
            [(10.0, 1e-3), (300.0, 0.1)].map(|(spin, h)| (free.with_timestep(h), spun(spin)));
        assert_eq!(are_carried(&swings), [true, false], "{method}");
    }
}

/// A link folded back onto the one before, under a tip a billion times heavier: what is lost lies in the angles' last bits.
#[test]
fn folded_arms_with_a_heavy_tip_lose_what_the_angles_have_lost() {
    let lost = digits_lost(1e9, PoseShape::Folded, 200).unwrap();
    println!("{lost:?}");
    assert!(lost.inherent.1 > 6.0, "{lost:?}");
    assert!(lost.recursion.1 < lost.inherent.1 + 2.5, "{lost:?}");
}
