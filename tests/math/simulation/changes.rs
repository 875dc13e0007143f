//! Changes from outside: a reset, control on and off, a state, a push. Each has its effect, and changes nothing else.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;

use super::moving;

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
    assert_eq!(simulation.effort(), &[0.0; 2], "no step since");
    assert_eq!(simulation.pid().integral(), &[0.0; 2]);
    assert_eq!(simulation.pid().setpoint(), &setpoint);
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

/// How many steps have the push in their effort.
fn pushed_steps(timestep: f64, duration: f64, before: u64) -> u64 {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.set_timestep(timestep);
    simulation.advance(before);
    simulation.disturb([1.0, 0.0], duration);
    let mut pushed = 0;
    for _ in 0..200 {
        simulation.step();
        pushed += u64::from(simulation.effort()[0] != 0.0);
    }
    pushed
}

/// Steps begin at 0, dt, 2 dt, ...: `duration / dt` of them before `duration`, rounded up. In binary 1.1 / 0.1 is a
/// little more than 11.
#[test]
fn a_disturbance_is_in_every_step_that_begins_within_its_time() {
    for (timestep, durations) in [
        (0.1, [(1.1, 11), (0.3, 3), (0.7, 7), (0.25, 3)]),
        (0.001, [(0.1, 100), (1e-9, 1), (5e-324, 1), (f64::MAX, 200)]),
    ] {
        for (duration, steps) in durations {
            for before in [0, 1, 7, 1000] {
                let pushed = pushed_steps(timestep, duration, before);
                assert_eq!(pushed, steps, "{timestep} {duration} {before}");
            }
        }
    }
}

#[test]
fn an_arm_whose_disturbance_is_over_steps_as_one_that_never_had_any() {
    let state = |push: bool| {
        let mut simulation = Simulation::<3>::new(Arm::default(), Gains::default());
        simulation.enable(true);
        if push {
            simulation.disturb([0.0; 3], 0.05);
        }
        simulation.advance(100);
        simulation
    };
    // Adding zeros changes no bit of an effort other than a zero's sign, which moves nothing.
    assert_eq!(state(true), state(false));
    let mut pushed = state(false);
    pushed.disturb([1.0; 3], 1.0);
    pushed.reset();
    let mut fresh = state(false);
    fresh.reset();
    assert_eq!(pushed, fresh);
}

/// The prediction of a step must use the effort of that step.
#[test]
fn the_predicted_effort_is_the_effort_of_the_next_step() {
    for on in [false, true] {
        let mut simulation = moving(Method::Rk4);
        simulation.enable(on);
        simulation.disturb([3.0, -5.0], 0.01);
        for step in 0..20 {
            let told = simulation.effort_of_next_step();
            simulation.step();
            assert_eq!(simulation.effort(), &told, "step {step}");
            assert_eq!(told == [0.0; 2], !on && step >= 10, "step {step}");
        }
    }
}

/// The arm has stood still for 2^30 s; numbers there are 2^-22 s apart, which is a step, and the push is shorter.
#[test]
fn a_disturbance_shorter_than_the_clock_can_tell_is_in_one_step() {
    let arm = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
    let mut simulation = Simulation::<2>::new(arm, Gains::default());
    simulation.set_timestep(2.0_f64.powi(30));
    simulation.advance(1);
    simulation.set_timestep(2.0_f64.powi(-22));
    simulation.disturb([1.0, 0.0], 1e-9);
    for effort in [[1.0, 0.0], [0.0, 0.0]] {
        assert_eq!(simulation.effort_of_next_step(), effort);
        simulation.advance(1);
        assert_eq!(simulation.effort(), &effort);
    }
}
