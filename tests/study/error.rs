//! Error against cost: the study's scenes agree with theory, and with the live arm.

use pendularm::math::integrator::Method;
use pendularm::report::experiments::budget::Budget;
use pendularm::report::experiments::error::{OUTPUTS, scenes};
use pendularm::report::experiments::task::LOST;

/// Halving the timestep divides the error by 2^p where truncation is all there is.
#[test]
fn every_method_has_its_order_in_every_scene_but_where_the_effort_is_held() {
    for scene in scenes() {
        // A held effort is half a step old on average: first order, whatever the method.
        let held = scene.is_held;
        let uncertainty = scene.task.uncertainty;
        let told = format!("{}: a millionth of the least error", scene.name);
        assert!(uncertainty < 1e-22, "{told}, {uncertainty:e}");
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
