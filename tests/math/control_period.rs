//! The control period: the runs of the law, and the held effort. `simulation/rules.rs` has the inputs that begin a period.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation, state_after};

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
