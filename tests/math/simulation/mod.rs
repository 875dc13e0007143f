//! The live loop: the exact steps of its inputs. [`rules`] has any inputs in any order.

mod rules;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Pid, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation};

#[test]
fn a_timestep_that_is_not_positive_is_refused_and_changes_nothing() {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    assert!(simulation.set_timestep(0.002));
    let before = simulation.clone();
    for timestep in [-0.01, 0.0, -0.0, f64::NAN, f64::INFINITY] {
        assert!(!simulation.set_timestep(timestep), "{timestep}");
    }
    assert_eq!(simulation, before);
}

#[test]
fn a_period_is_the_nearest_number_of_steps_and_one_at_least() {
    for (period, timestep, steps) in [
        (0.0, 1e-3, 1),
        (4e-4, 1e-3, 1),
        (1.4e-3, 1e-3, 1),
        (1.6e-3, 1e-3, 2),
        (0.01, 1e-4, 100),
        (0.01, 3e-3, 3),
        (f64::MAX, f64::MIN_POSITIVE, 1 << 53),
    ] {
        let delay = 0;
        let period = ControlPeriod { period, delay };
        assert_eq!(period.steps(timestep), steps, "{period:?} of {timestep}");
        let length = steps as f64 * timestep;
        assert_eq!(period.effective(timestep).to_bits(), length.to_bits());
    }
}

/// A stretched arm without gravity turns evenly. A rounding error in every step would add up to some 1e-10 rad.
#[test]
fn the_rounding_errors_of_steps_do_not_add_up() {
    for method in Method::ALL {
        let mut simulation = Simulation::<2>::new(Arm::default().weightless(), Gains::default());
        simulation.set_method(method);
        simulation.set_state(State {
            position: [0.0; 2],
            velocity: [1.0, 0.0],
        });
        simulation.advance(100_000);
        let off = simulation.state().position[0] - simulation.time();
        assert!(off.abs() < 1e-13, "{method}: {off}");
    }
}

#[test]
fn a_state_that_is_put_in_has_no_rounding_error_of_the_old_one() {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.advance(1234);
    assert_ne!(simulation.checkpoint().carry, State::rest());
    simulation.set_state(*simulation.clone().state());
    assert_eq!(simulation.checkpoint().carry, State::rest());
}

/// How many steps have the push in their effort.
fn pushed_steps(timestep: f64, duration: f64, before: u64) -> u64 {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.set_timestep(timestep);
    simulation.advance(before);
    simulation.disturb([1.0, 0.0], duration);
    let mut pushed = 0;
    for _ in 0..200 {
        let effort = simulation.effort_of_next_step();
        simulation.step();
        assert_eq!(simulation.effort(), &effort);
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

/// The arm has stood still for 2^30 s; numbers there are 2^-22 s apart, which is a step, and the push is shorter.
#[test]
fn a_disturbance_shorter_than_the_clock_can_tell_is_in_one_step() {
    let mut simulation = Simulation::<2>::new(Arm::default().weightless(), Gains::default());
    simulation.set_timestep(2.0_f64.powi(30));
    simulation.advance(1);
    simulation.set_timestep(2.0_f64.powi(-22));
    simulation.disturb([1.0, 0.0], 1e-9);
    for effort in [[1.0, 0.0], [0.0, 0.0]] {
        simulation.advance(1);
        assert_eq!(simulation.effort(), &effort);
    }
}

#[test]
fn another_method_and_another_arm_act_from_the_next_step_on() {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.advance(100);
    let heavy = Arm::new([1.0, 1.0], [1.0, 3.0], 5.0).unwrap();
    let mut changed = simulation.clone();
    changed.set_arm(heavy);
    assert_eq!(changed.arm(), &heavy);
    let mut euler = simulation.clone();
    euler.set_method(Method::Euler);
    for one in [&mut simulation, &mut changed, &mut euler] {
        one.step();
    }
    let velocity = simulation.state().velocity;
    assert_ne!(changed.state().velocity, velocity);
    assert_ne!(euler.state().velocity, velocity);
}

#[test]
fn only_a_start_and_a_reset_of_the_controller_empty_its_integral() {
    let mut law = Pid::<2>::new(Gains::default());
    let (filled, empty) = ([0.5, -0.25], [0.0; 2]);
    law.commit(filled);
    assert_eq!(*law.integral(), filled);
    law.enable(false);
    assert_eq!(*law.integral(), filled);
    law.enable(true);
    assert_eq!(*law.integral(), empty, "from off to on");
    law.commit(filled);
    law.enable(true);
    assert_eq!(*law.integral(), filled, "already on");
    law.set_setpoint(Setpoint::at([1.0, 2.0]));
    law.reset();
    let reset = (*law.integral(), law.setpoint().position, law.is_enabled());
    assert_eq!(reset, (empty, empty, true));
}
