//! Divergence: the first step that is not finite is not taken, and no step follows it.

use std::ops::ControlFlow;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{Checkpoint, ControlPeriod, Divergence, Simulation};

/// Ten times the timestep that the default gains are stable to, and a law that runs late and in every second step.
fn unstable<const N: usize>(gains: Gains<N>, method: Method) -> Simulation<N> {
    let mut simulation = Simulation::new(Arm::default(), gains);
    simulation.set_method(method);
    simulation.set_timestep(0.03);
    simulation.set_control_period(ControlPeriod {
        period: 0.06,
        delay: 1,
    });
    simulation.set_setpoint(Setpoint::at([0.5; N]));
    simulation.enable(true);
    simulation
}

fn check_divergence<const N: usize>(gains: Gains<N>, method: Method) {
    let mut before = unstable(gains, method);
    let mut simulation = before.clone();
    let taken = simulation.advance(1_000_000);
    assert!(taken < 1_000_000, "{method} is stable");
    let divergence = simulation.divergence().unwrap();
    let (step, time) = (taken + 1, simulation.time());
    assert_eq!(divergence, Divergence { step, time });

    // All other values are those of the last taken step.
    assert_eq!(before.advance(taken), taken);
    let rest = Checkpoint {
        divergence: None,
        ..simulation.checkpoint()
    };
    assert_eq!(rest, before.checkpoint());
    assert!(simulation.state().is_finite());

    // Only a reset or a new state ends the divergence.
    let held = simulation.clone();
    assert!(!simulation.step());
    assert_eq!(simulation.advance(1000), 0);
    assert_eq!(simulation, held);
    simulation.enable(false);
    simulation.set_timestep(1e-4);
    assert!(!simulation.step());
    assert_eq!(simulation.divergence(), Some(divergence));
    assert_eq!(simulation.time(), divergence.time);
    let mut put = simulation.clone();
    put.set_state(State::rest());
    assert_eq!(put.divergence(), None);
    assert_eq!(put.time(), divergence.time);
    assert_eq!(put.advance(1000), 1000);
    simulation.reset();
    assert_eq!(simulation.divergence(), None);
    assert_eq!(simulation.advance(1000), 1000);
}

#[test]
fn a_timestep_too_large_for_the_gains_diverges_and_holds_its_last_finite_state_until_a_reset() {
    for method in Method::ALL {
        check_divergence::<2>(Gains::default(), method);
        check_divergence::<3>(Gains::default(), method);
    }
}

/// An arm at rest without gravity, whose state stays finite at every timestep.
fn resting(timestep: f64) -> Simulation<2> {
    let mut simulation = Simulation::new(Arm::default().weightless(), Gains::default());
    simulation.set_timestep(timestep);
    simulation
}

/// The clock does not advance, because `base + k timestep` is rounded. The state changes.
#[test]
fn a_timestep_that_rounding_loses_is_stepped_all_the_same() {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    assert!(simulation.step());
    simulation.set_timestep(1e-300);
    assert_eq!(simulation.advance(3), 3);
    assert_eq!((simulation.time(), simulation.steps()), (0.001, 4));
    simulation.set_timestep(0.001);
    assert_eq!(simulation.advance(3), 3);
    assert_eq!((simulation.time(), simulation.divergence()), (0.004, None));
}

#[test]
fn an_observer_is_shown_the_steps_that_are_taken_in_order_and_may_end_an_advance() {
    let advance = |simulation: &mut Simulation<2>| {
        let (before, mut shown) = (simulation.steps(), Vec::new());
        let taken = simulation.advance_with(1_000_000, |now| {
            assert!(now.state().is_finite());
            shown.push(now.steps());
            ControlFlow::Continue(())
        });
        assert!(simulation.divergence().is_some());
        assert!(shown.into_iter().eq(before + 1..=before + taken));
        taken
    };
    assert!(advance(&mut unstable(Gains::default(), Method::Euler)) > 1);
    // Near the end of time it may also end an advance.
    let mut simulation = resting(5e307);
    let advanced = simulation.advance_with(9, |_| ControlFlow::Break(()));
    assert_eq!((advanced, simulation.steps()), (1, 1));
    assert_eq!((advance(&mut simulation), simulation.time()), (2, 1.5e308));
}
