//! Changes from outside: a reset, gains, control on and off, parameters and states, each with what it keeps.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::simulation::Simulation;

use super::{moving, no_gains};

#[test]
fn a_reset_puts_back_pose_clock_setpoint_integral_and_effort_and_nothing_else() {
    let mut simulation = moving(Method::Verlet);
    simulation.set_timestep(0.002);
    simulation.set_arm(Arm::new([0.5, 1.5], [2.0, 1.0], 3.7).unwrap());
    let mut expected = Simulation::new(*simulation.arm(), *simulation.pid().gains());
    expected.set_method(Method::Verlet);
    expected.set_timestep(0.002);
    expected.enable(true);
    simulation.advance(333);
    assert_ne!(simulation.effort(), &[0.0; 2]);
    simulation.reset();
    assert_eq!(simulation, expected);
    assert_eq!(simulation.time(), 0.0);
    assert!(simulation.pid().is_enabled());
}

#[test]
fn new_gains_are_those_of_the_next_step() {
    let mut simulation = moving(Method::Rk4);
    simulation.enable(true);
    simulation.set_gains(no_gains());
    assert_eq!(simulation.pid().gains(), &no_gains());
    simulation.step();
    assert_eq!(simulation.effort(), &[0.0; 2]);
}

#[test]
fn disabling_control_zeroes_the_effort_at_once_and_leaves_the_motion() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(50);
    let state = *simulation.state();
    assert_ne!(simulation.effort(), &[0.0; 2]);
    simulation.enable(false);
    assert_eq!(simulation.effort(), &[0.0; 2]);
    assert_eq!(simulation.state(), &state);
    let setpoint = *simulation.pid().setpoint();
    simulation.enable(true);
    assert_eq!(
        simulation.effort(),
        &[0.0; 2],
        "no step has been taken since"
    );
    assert_eq!(simulation.pid().integral(), &[0.0; 2]);
    assert_eq!(simulation.pid().setpoint(), &setpoint);
}

#[test]
fn new_parameters_keep_the_joints_where_they_are() {
    let mut simulation = moving(Method::Rk4);
    simulation.advance(50);
    let mut heavier = simulation.clone();
    heavier.set_arm(Arm::new([1.0, 1.0], [1.0, 4.0], 9.81).unwrap());
    assert_eq!(heavier.state(), simulation.state());
    heavier.step();
    simulation.step();
    assert_ne!(heavier.state(), simulation.state());
}

#[test]
fn a_state_that_is_put_in_carries_nothing_over_from_the_old_one() {
    let mut simulation = moving(Method::Rk4);
    simulation.enable(false);
    simulation.advance(1234);
    let state = *simulation.state();
    let mut fresh = Simulation::new(*simulation.arm(), *simulation.pid().gains());
    simulation.set_state(state);
    fresh.set_state(state);
    simulation.advance(100);
    fresh.advance(100);
    assert_eq!(simulation.state(), fresh.state());
}
