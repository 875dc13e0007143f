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
            let told = format!("{} {method}: order {order}", scene.name);
            assert!(
                (order - expected).abs() < 0.2,
                "{told}, expected {expected}"
            );
        }
    }
}

/// The timed steps (of the live arm's stepper) and the counted steps are the same: the sums of their last angles are
/// equal in every scene, to the last bit. Evaluations are counted and not estimated.
#[test]
fn the_steps_that_are_timed_are_the_steps_that_are_judged() {
    for scene in scenes() {
        assert!(
            scene.task.uncertainty < 1e-22,
            "{}: a millionth of the least error",
            scene.name
        );
        for method in Method::ALL {
            let told = format!("{} {method}", scene.name);
            let outcome = scene.task.run(method, 8192, LOST);
            let expected = 8192 * u64::from(method.evaluations());
            assert_eq!(outcome.evaluations, expected, "{told}");
            let sum = scene.task.replay(method, 8192);
            assert!(sum.is_finite(), "{told}");
            assert_eq!(outcome.end.to_bits(), sum.to_bits(), "{told}");
        }
    }
}

#[test]
fn a_run_past_its_stability_limit_counts_as_diverged() {
    let mut all = scenes().into_iter();
    let reach = all.find(|scene| scene.name == "reach-held").unwrap();
    // 31 ms, where the held effort allows 21.7 ms.
    let error = |steps| reach.task.run(Method::Rk4, steps, LOST).error;
    assert!(error(OUTPUTS) > 0.1);
    assert!(error(4 * OUTPUTS).is_finite());
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

/// Halving the timestep of a method of order 2 divides its energy error by four, and a symplectic one's does not grow.
#[test]
fn the_symplectic_baseline_is_of_order_two_and_its_energy_error_does_not_grow() {
    let arm = Arm::<2>::default();
    let regular = State::at_rest([0.3 - std::f64::consts::FRAC_PI_2, 0.0]);
    let last = |drift: Vec<(f64, f64)>| drift.last().unwrap().1;
    let end = |h, duration| last(symplectic_drift(&arm, &regular, h, duration));
    let ratio = end(2e-3, 20.0) / end(1e-3, 20.0);
    assert!((ratio - 4.0).abs() < 0.1, "{ratio}");
    let growth = end(1e-3, 100.0) / end(1e-3, 10.0);
    assert!(growth < 1.2, "{growth}");
    // Midpoint with the same order is not symplectic: its error keeps growing. Euler's is a thousand times Runge-Kutta's.
    let drift = |state, method, duration| last(energy_drift(&arm, &state, method, 1e-3, duration));
    let midpoint = |duration| drift(regular, Method::Midpoint, duration);
    assert!(midpoint(100.0) / midpoint(10.0) > 3.0);
    let [euler, rk4] = [Method::Euler, Method::Rk4].map(|method| drift(State::rest(), method, 5.0));
    assert!(euler > 1e3 * rk4, "{euler} {rk4}");
}
