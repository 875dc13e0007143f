//! Steps: their start, their parts, the sums of rounding and time, and observers.

use std::ops::ControlFlow;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::simulation::Simulation;

use super::{moving, no_gains};

/// The law is not evaluated while the controller is off. No bit differs from a law with gains of zero.
#[test]
fn many_steps_at_once_are_the_same_bits_as_one_by_one_and_control_that_is_off_as_gains_of_zero() {
    for method in Method::ALL {
        for on in [false, true] {
            let mut at_once = moving(method);
            at_once.enable(on);
            let (mut one_by_one, mut zero) = (at_once.clone(), at_once.clone());
            assert_eq!(at_once.advance(1000), 1000);
            assert!((0..1000).all(|_| one_by_one.step()));
            assert_eq!(at_once, one_by_one, "{method}");
            if !on {
                zero.set_gains(no_gains());
                zero.enable(true);
                assert_eq!(zero.advance(1000), 1000);
                assert_eq!(at_once.state(), zero.state(), "{method}");
            }
        }
    }
}

/// A link that turns at 0.1 rad/s without gravity moves by the same increment each step. A million of them add up to
/// the product. A plain sum would be off by thousands of units in the last place.
#[test]
fn a_million_tiny_steps_lose_no_digit() {
    let arm = Arm::new([1.0], [1.0], 0.0).unwrap();
    let mut simulation = Simulation::new(arm, no_gains());
    simulation.set_method(Method::Euler);
    simulation.set_timestep(1e-6);
    simulation.set_state(State {
        position: [0.0],
        velocity: [0.1],
    });
    simulation.advance(1_000_000);
    let [q] = simulation.state().position;
    assert!((q - 1e6 * (1e-6 * 0.1)).abs() <= 0.1 * f64::EPSILON, "{q}");
    assert_eq!(simulation.time(), 1.0);
}

#[test]
fn time_is_a_product_also_over_a_new_timestep_or_the_same_one_again() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(100_000);
    assert_eq!(simulation.time(), 100.0);
    simulation.set_timestep(0.0003);
    assert_eq!(simulation.time(), 100.0);
    for _ in 0..700 {
        simulation.set_timestep(0.0003);
        simulation.step();
    }
    simulation.set_method(Method::Euler);
    assert_eq!(simulation.time(), 100.0 + 700.0 * 0.0003);
    assert_eq!(simulation.steps(), 100_700);
}

#[test]
fn an_observer_sees_every_step_in_order_and_may_end_the_advance() {
    let mut simulation = moving(Method::Midpoint);
    simulation.advance(10);
    let mut seen = Vec::new();
    let taken = simulation.advance_with(100, |now| {
        seen.push(now.steps());
        match now.steps() {
            15 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    assert_eq!(taken, 5);
    assert_eq!(seen, [11, 12, 13, 14, 15]);
    assert_eq!(simulation.steps(), 15);
}
