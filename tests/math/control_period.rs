//! The control period: the runs of the law, the held effort, and the events that begin a period.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ArmInput, ControlPeriod, Simulation, state_after};

const SETPOINT: [f64; 2] = [0.4, 0.8];

fn late(period: f64) -> ControlPeriod {
    ControlPeriod {
        period,
        delay: true,
    }
}

fn every(period: f64) -> ControlPeriod {
    ControlPeriod {
        delay: false,
        ..late(period)
    }
}

/// The default arm on its way to a setpoint.
fn reaching(timestep: f64, period: ControlPeriod) -> Simulation<2> {
    let mut simulation = Simulation::new(Arm::default(), Gains::default());
    simulation.set_timestep(timestep);
    simulation.set_control_period(period);
    simulation.enable(true);
    simulation.set_setpoint(Setpoint::at(SETPOINT));
    simulation
}

fn is_same(one: &Simulation<2>, other: &Simulation<2>) {
    assert_eq!(format!("{one:?}"), format!("{other:?}"));
}

/// The loop written once more, by the law and the method alone.
#[test]
fn the_law_runs_every_k_steps_with_the_period_as_its_dt_and_its_effort_is_held() {
    const K: u64 = 7;
    for method in Method::ALL {
        for delay in [false, true] {
            let period = if delay { late(7.3e-3) } else { every(7.3e-3) };
            let mut simulation = reaching(1e-3, period);
            simulation.set_method(method);
            let mut law = simulation.pid().clone();
            let (mut effort, mut computed) = ([0.0; 2], [0.0; 2]);
            for step in 0..500 {
                let state = *simulation.state();
                if step % K == 0 {
                    let control = law.control(&state, 7.0 * 1e-3);
                    law.commit(control.integral);
                    effort = if delay { computed } else { control.effort };
                    computed = control.effort;
                }
                let next = state_after(simulation.arm(), method, &state, &effort, 1e-3);
                assert!(simulation.step());
                // The simulation carries its rounding errors.
                for (one, other) in next.position.iter().zip(&simulation.state().position) {
                    assert!((one - other).abs() < 1e-14, "{method}, step {step}");
                }
                assert_eq!(*simulation.effort(), effort);
                assert_eq!(simulation.pid().integral(), law.integral());
            }
        }
    }
}

#[test]
fn a_period_is_the_nearest_number_of_steps_and_one_at_least() {
    for (period, timestep, steps) in [
        (0.0, 1e-3, 1),
        (4e-4, 1e-3, 1),
        (1e-3, 1e-3, 1),
        (1.4e-3, 1e-3, 1),
        (1.6e-3, 1e-3, 2),
        (0.01, 1e-3, 10),
        (0.01, 1e-4, 100),
        (0.01, 3e-3, 3),
        (0.01, 1.0, 1),
        (f64::MAX, f64::MIN_POSITIVE, 1 << 53),
    ] {
        let period = every(period);
        assert_eq!(period.steps(timestep), steps, "{period:?} of {timestep}");
        let length = steps as f64 * timestep;
        assert_eq!(period.effective(timestep).to_bits(), length.to_bits());
    }
}

#[test]
fn gains_and_setpoints_count_from_the_next_period_on() {
    let mut simulation = reaching(1e-3, every(0.01));
    simulation.advance(14);
    let held = *simulation.effort();
    simulation.set_setpoint(Setpoint::at([-1.0, 2.0]));
    simulation.set_gains(Gains {
        kp: [1.0; 2],
        ..*simulation.pid().gains()
    });
    for _ in 14..20 {
        simulation.step();
        assert_eq!(*simulation.effort(), held);
    }
    simulation.step();
    assert_ne!(*simulation.effort(), held);
}

/// Within a period, and what should begin the next one at once.
#[test]
fn a_reset_a_switch_a_timestep_another_period_and_the_end_of_driving_begin_a_period() {
    type Change = fn(&mut Simulation<2>);
    let changes: [(&str, Change); 5] = [
        ("reset", Simulation::reset),
        ("switch", |simulation| {
            simulation.enable(false);
            simulation.enable(true);
        }),
        ("timestep", |simulation| simulation.set_timestep(2e-3)),
        ("period", |simulation| {
            simulation.set_control_period(every(0.02));
        }),
        ("driving", |simulation| {
            simulation.drive(Some([1.0, 2.0]));
            simulation.drive(None);
        }),
    ];
    for (what, change) in changes {
        let mut simulation = reaching(1e-3, every(0.01));
        simulation.advance(14);
        change(&mut simulation);
        simulation.set_setpoint(Setpoint::at([-1.0, 2.0]));
        let period = simulation.control_period().effective(simulation.timestep());
        let control = simulation.pid().control(simulation.state(), period);
        assert_eq!(simulation.effort_of_next_step(), control.effort, "{what}");
        simulation.step();
        assert_eq!(*simulation.effort(), control.effort, "{what}");
        let steps = simulation.control_period().steps(simulation.timestep());
        for _ in 1..steps {
            simulation.step();
            assert_eq!(*simulation.effort(), control.effort, "{what}");
        }
        simulation.step();
        assert_ne!(*simulation.effort(), control.effort, "{what}");
    }
    // A value that is already active does not begin a period.
    let mut simulation = reaching(1e-3, every(0.01));
    simulation.advance(14);
    let before = simulation.clone();
    simulation.enable(true);
    simulation.set_timestep(1e-3);
    simulation.set_control_period(every(0.01));
    is_same(&simulation, &before);
}

#[test]
fn a_timestep_keeps_the_period_that_was_asked_for() {
    let mut simulation = reaching(1e-3, every(0.01));
    simulation.set_timestep(3e-3);
    assert_eq!(simulation.control_period(), every(0.01));
    let held = |simulation: &mut Simulation<2>| {
        simulation.step();
        let effort = *simulation.effort();
        let mut steps = 1;
        while simulation.effort_of_next_step() == effort {
            simulation.step();
            steps += 1;
        }
        steps
    };
    assert_eq!(held(&mut simulation), 3);
    simulation.set_timestep(1e-4);
    assert_eq!(held(&mut simulation), 100);
}

#[test]
fn commands_are_applied_while_the_controller_is_off_and_end_with_a_switch_or_a_reset() {
    let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
    simulation.set_command([3.0, -1.0]);
    assert_eq!(simulation.effort_of_next_step(), [3.0, -1.0]);
    simulation.step();
    assert_eq!(*simulation.effort(), [3.0, -1.0]);
    let switches = [true, false].map(ArmInput::Enabled);
    let others = [ArmInput::Reset, ArmInput::Command([0.0; 2])];
    for end in switches.into_iter().chain(others) {
        simulation.enable(false);
        simulation.set_command([3.0, -1.0]);
        simulation.disturb([1.0, 1.0], 1.0);
        simulation.step();
        assert_eq!(*simulation.effort(), [4.0, 0.0]);
        simulation.apply(end);
        simulation.enable(false);
        assert_eq!(*simulation.command(), [0.0; 2], "{end:?}");
    }
}

#[test]
fn the_controller_does_not_run_while_a_client_drives_the_arm() {
    for enabled in [false, true] {
        let mut simulation = reaching(1e-3, every(0.01));
        simulation.advance(5);
        simulation.enable(enabled);
        let integral = *simulation.pid().integral();
        simulation.drive(Some([2.0, 1.0]));
        for _ in 0..20 {
            simulation.step();
            assert_eq!(*simulation.effort(), [2.0, 1.0]);
        }
        assert_eq!(*simulation.pid().integral(), integral);
        simulation.drive(None);
        simulation.step();
        assert_ne!(*simulation.effort(), [2.0, 1.0]);
    }
}

/// A step that is not taken changes nothing, even if the law ran for it.
#[test]
fn a_step_that_is_not_taken_holds_nothing() {
    for steps in [1, 2, 10] {
        let mut simulation = reaching(1.0, late(steps as f64));
        let mut before = simulation.clone();
        while simulation.step() {
            before = simulation.clone();
        }
        let (after, before) = (simulation.checkpoint(), before.checkpoint());
        assert_eq!(after.held, before.held);
        assert_eq!(after.integral, before.integral);
    }
}

#[test]
fn a_simulation_goes_on_from_a_checkpoint_within_a_period() {
    let mut simulation = reaching(1e-3, late(0.01));
    for steps in [3, 1, 11, 20] {
        simulation.advance(steps);
        let mut other = Simulation::continued(&simulation.checkpoint());
        is_same(&other, &simulation);
        other.advance(50);
        simulation.advance(50);
        is_same(&other, &simulation);
    }
}
