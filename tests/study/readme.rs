//! The three findings of the README are run again.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::budget::Budget;
use pendularm::report::experiments::error::scenes;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::fewest::StepSearch;
use pendularm::study::stability::limits;

use crate::recomputed::printed;

const README: &str = include_str!("../../README.md");

/// Whether a number is the printed one, of three digits or two.
fn assert_printed(before: &str, value: f64, part: f64) {
    let printed = printed(README, before);
    let off = (printed / value - 1.0).abs();
    assert!(off < part, "{before}{printed} for {value}");
}

#[test]
fn the_longest_timestep_of_runge_kutta_is_that_of_a_run() {
    let all = scenes();
    let swing = all.iter().find(|scene| scene.name() == "swing-2").unwrap();
    let fewest = |method| {
        let mut search = StepSearch::new(1, 1 << 12);
        while let Some(steps) = search.wanted() {
            search.tell(swing.run_within(method, steps, 1e-4).error <= 1e-4);
        }
        let steps = search.best().unwrap();
        let run = swing.run(method, steps);
        assert!(run.error <= 1e-4, "{run:?}");
        run
    };
    let (rk4, verlet) = (fewest(Method::Rk4), fewest(Method::Verlet));
    assert_printed("RK4 takes steps of ", rk4.timestep, 5e-3);
    let per_second = rk4.evaluations as f64 / 2.0;
    assert_printed("ms**, and ", per_second.round(), 5e-3);
    let ratio = verlet.evaluations as f64 / rk4.evaluations as f64;
    assert_printed("Verlet needs ", ratio, 5e-3);
}

#[test]
fn the_parts_of_the_reachs_error_are_those_of_a_run() {
    // 2 s in 2048 steps.
    let parts = Budget::new(true, 2.0).parts(&[Method::Rk4], 2048)[0];
    assert!((parts.timestep - 977e-6).abs() < 1e-6);
    assert_printed("holding the effort costs ", parts.hold, 0.03);
    assert_printed("RK4's truncation ", parts.truncation, 0.03);
    assert_printed("and rounding ", parts.rounding, 0.03);
}

#[test]
fn the_limits_are_those_of_the_loop() {
    let loop_of = |method| {
        let control = ControlLoop::new(
            Arm::<2>::default(),
            Gains::default(),
            Setpoint::at([0.4, 0.8]),
        );
        limits(&control.with_method(method))
    };
    let (rk4, verlet) = (loop_of(Method::Rk4), loop_of(Method::Verlet));
    assert_printed("goes unstable at ", rk4.held.unwrap(), 5e-3);
    assert_printed("with RK4 and at ", verlet.held.unwrap(), 5e-3);
    assert_printed("RK4 would be stable up to ", rk4.continuous.unwrap(), 5e-3);
    assert_printed(
        "The smallest limit of all poses is ",
        rk4.minimum_held.unwrap(),
        5e-3,
    );
}
