//! Another state, and the exact steps of a disturbance. `rules.rs` has all other inputs.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;

use super::moving;

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
