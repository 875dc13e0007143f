//! Error against cost: the study's scenes agree with theory, and with the live arm.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::report::experiments::budget::Budget;
use pendularm::report::experiments::chaos::{energy_drift, symplectic_drift};
use pendularm::report::experiments::error::{OUTPUTS, scenes};
use pendularm::report::experiments::task::LOST;

/// Halving the timestep divides the error by 2^p where truncation is all there is.
#[test]
fn every_method_has_its_order_in_every_scene_but_where_the_effort_is_held() {
    for scene in scenes() {
        // A held effort is half a step old on average: first order, whatever the method.
        let held = scene.is_held;
        for method in Method::ALL {
            // Fine enough for the leading term to be all of the error, also of Euler in a whirl.
            let steps = match method.order() {
                1 => 1 << 17,
                2 => 1 << 14,
                _ => 1 << 11,
            };
            let coarse = scene.task.run(method, steps, LOST);
            let fine = scene.task.run(method, 2 * steps, LOST);
            let order = (coarse.error / fine.error).log2();
            let expected = if held { 1.0 } else { f64::from(method.order()) };
            assert!(
                (order - expected).abs() < 0.2,
                "{} {method}: order {order}, expected {expected}",
                scene.name
            );
        }
    }
}

#[test]
fn evaluations_are_counted_and_not_estimated() {
    for scene in scenes() {
        for method in Method::ALL {
            let outcome = scene.task.run(method, 8192, LOST);
            let expected = 8192 * u64::from(method.evaluations());
            assert_eq!(outcome.evaluations, expected, "{} {method}", scene.name);
        }
    }
}

/// The timed steps (of the live arm's stepper) and the counted steps are the same: the sums of their last angles are
/// equal in every scene, to the last bit.
#[test]
fn the_steps_that_are_timed_are_the_steps_that_are_judged() {
    for scene in scenes() {
        for method in Method::ALL {
            let end = scene.task.run(method, 8192, LOST).end;
            let sum = scene.task.replay(method, 8192);
            assert!(sum.is_finite(), "{} {method}", scene.name);
            assert_eq!(end.to_bits(), sum.to_bits(), "{} {method}", scene.name);
        }
    }
}

#[test]
fn a_run_past_its_stability_limit_counts_as_diverged() {
    let reach = scenes()
        .into_iter()
        .find(|s| s.name == "reach-held")
        .unwrap();
    // 31 ms, where the held effort allows 21.7 ms.
    let error = |steps| reach.task.run(Method::Rk4, steps, LOST).error;
    assert!(error(OUTPUTS) > 0.1);
    assert!(error(4 * OUTPUTS).is_finite());
}

#[test]
fn references_are_a_million_times_better_than_the_smallest_error_shown() {
    for scene in scenes() {
        assert!(
            scene.task.uncertainty < 1e-22,
            "{}: {:e}",
            scene.name,
            scene.task.uncertainty
        );
    }
}

/// The three parts of an error are vectors: they may cancel, but their sizes bound the whole.
#[test]
fn the_parts_of_an_error_add_up() {
    for control in [false, true] {
        for parts in Budget::new(control, 2.0).parts(&Method::ALL, 8 * OUTPUTS) {
            let sum = parts.truncation + parts.rounding + parts.hold;
            assert!(parts.total <= sum * (1.0 + 1e-9), "{parts:?}");
            assert!(parts.rounding < 1e-12, "{parts:?}");
            assert_eq!(parts.hold > 0.0, control, "{parts:?}");
        }
    }
}

#[test]
fn euler_gains_energy_a_thousand_times_faster_than_runge_kutta() {
    let arm = Arm::<2>::default();
    let end = |method| {
        energy_drift(&arm, &State::rest(), method, 1e-3, 5.0)
            .last()
            .unwrap()
            .1
    };
    assert!(end(Method::Euler) > 1e3 * end(Method::Rk4));
}

/// Halving the timestep of a method of order 2 divides its energy error by four, and a symplectic one's does not grow.
#[test]
fn the_symplectic_baseline_is_of_order_two_and_its_energy_error_does_not_grow() {
    let arm = Arm::<2>::default();
    let regular = State::at_rest([0.3 - std::f64::consts::FRAC_PI_2, 0.0]);
    let end = |h, duration| {
        symplectic_drift(&arm, &regular, h, duration)
            .last()
            .unwrap()
            .1
    };
    let ratio = end(2e-3, 20.0) / end(1e-3, 20.0);
    assert!((ratio - 4.0).abs() < 0.1, "{ratio}");
    let growth = end(1e-3, 100.0) / end(1e-3, 10.0);
    assert!(growth < 1.2, "{growth}");
    // Midpoint with the same order is not symplectic: its error keeps growing.
    let midpoint = |duration| {
        energy_drift(&arm, &regular, Method::Midpoint, 1e-3, duration)
            .last()
            .unwrap()
            .1
    };
    assert!(midpoint(100.0) / midpoint(10.0) > 3.0);
}
