//! The study with friction: predicted limits against runs, and the reference against small steps.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Sampling, largest_timestep};
use pendularm::study::taylor::TaylorReference;

/// A hanging arm whose friction is stiff: each method is stable just below its predicted limit, and not just above.
#[test]
fn the_timestep_limit_of_a_damped_arm_is_that_of_its_runs() {
    for viscous in [[40.0, 20.0], [1000.0, 5.0]] {
        let arm = Arm::default().with_friction(viscous).unwrap();
        for method in Method::ALL {
            let control = ControlLoop::<2>::free(arm).with_method(method);
            let linear = Linear::at_setpoint(&control);
            let limit = largest_timestep(&linear, method, Sampling::Held).unwrap();
            let size_after = |part: f64| {
                let hanging = [-std::f64::consts::FRAC_PI_2 + 1e-9, 1e-9];
                let start = State::at_rest(hanging);
                let mut run = control.with_timestep(part * limit).simulation(start);
                run.advance(2000);
                run.state()
                    .velocity
                    .iter()
                    .fold(0.0_f64, |most, v| most.max(v.abs()))
            };
            let (below, above) = (size_after(0.98), size_after(1.02));
            assert!(
                below < 1e-8,
                "{method} {viscous:?}: {below} rad/s at 0.98 of {limit} s"
            );
            assert!(
                above > 1e-3,
                "{method} {viscous:?}: {above} rad/s at 1.02 of {limit} s"
            );
        }
    }
}

#[test]
fn the_reference_of_a_damped_arm_is_the_limit_of_small_steps() {
    let arm = Arm::default().with_friction([0.8, 0.3]).unwrap();
    let start = State::at_rest([0.3, -0.4]);
    let mut reference = TaylorReference::new(start);
    assert!(reference.follow(&arm, &[1.0, -0.5], 1.0));
    let mut run = ControlLoop::<2>::free(arm)
        .with_timestep(2.5e-4)
        .simulation(start);
    run.set_command([1.0, -0.5]);
    run.advance(4000);
    for i in 0..2 {
        let off = (run.state().position[i] - reference.state().position[i]).abs();
        assert!(off < 1e-12, "joint {i}: {off}");
    }
}
