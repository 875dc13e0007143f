//! The study with sensors, delays and limits: predicted limits of the period against runs, and errors of runs.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::limits::Limits;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::sensors::{Sensors, VelocitySource};
use pendularm::math::simulation::ControlPeriod;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::paused::at_once;
use pendularm::study::rollout::{RolloutRequest, rollout};
use pendularm::study::stability::Stepping;

const POSE: [f64; 2] = [0.4, 0.8];

/// A loop without gravity, so that it rests at its setpoint without an effort.
fn weightless(velocity: VelocitySource) -> ControlLoop<2> {
    let arm = Arm::default().weightless();
    let control = ControlLoop::new(arm, Gains::default(), Setpoint::at(POSE));
    ControlLoop {
        sensors: Sensors {
            velocity,
            ..Sensors::default()
        },
        ..control
    }
}

/// The factor by which a small deviation changes in many periods of a fraction of the limit.
fn growth(control: &ControlLoop<2>, delay: u8, substeps: u32, period: f64) -> f64 {
    let control = control
        .with_timestep(period / f64::from(substeps))
        .with_period(ControlPeriod { period, delay });
    let mut run = control.simulation(State::at_rest(POSE.map(|q| q + 1e-9)));
    let size = |state: &State<2>| {
        let off =
            (0..2).map(|i| (state.position[i] - POSE[i]).abs() + period * state.velocity[i].abs());
        off.fold(0.0, f64::max)
    };
    let largest_of = |run: &mut pendularm::math::simulation::Simulation<2>| {
        (0..100 * substeps).fold(0.0_f64, |most, _| {
            run.step();
            most.max(size(run.state()))
        })
    };
    run.advance(200 * u64::from(substeps));
    let before = largest_of(&mut run);
    // Modes of long delays change slowly.
    run.advance(400 * u64::from(substeps) * (2 + u64::from(delay)));
    largest_of(&mut run) / before
}

#[test]
fn the_limit_of_the_period_with_any_delay_and_with_differences_is_that_of_runs() {
    let mut last = [f64::INFINITY; 2];
    for delay in [0, 1, 2, 3, 16] {
        for (kind, velocity) in VelocitySource::ALL.into_iter().enumerate() {
            let control = weightless(velocity);
            let linear = Linear::at_setpoint(&control);
            let limit = Stepping::held(&linear, Method::Rk4, 4, delay)
                .limit()
                .unwrap();
            assert!(limit < last[kind], "{delay} {velocity:?}: {limit}");
            last[kind] = limit;
            let [below, above] = [0.97, 1.03].map(|part| growth(&control, delay, 4, part * limit));
            let told = format!("{delay} {velocity:?}: {below} and {above} around {limit} s");
            assert!(below < 0.5 && above > 2.0, "{told}");
        }
        assert!(last[1] < last[0], "a difference is half a period older");
    }
}

/// The error of the held effort is against a law without limits, so it is unknown from the first limited effort on.
#[test]
fn the_error_of_the_held_effort_is_unknown_once_an_effort_was_at_its_limit() {
    let control = ControlLoop::new(Arm::default(), Gains::default(), Setpoint::at([0.3, 0.1]));
    let run = |effort| {
        let limits = Limits {
            effort,
            ..Limits::default()
        };
        let made = at_once(rollout(RolloutRequest {
            control: ControlLoop { limits, ..control },
            start: State::at_rest([0.0; 2]),
            duration: 0.5,
            samples: 6,
            reference: true,
        }));
        let made = made.unwrap();
        let errors = [made.deviation, made.from_ideal];
        errors.map(|deviation| made.known(deviation.as_ref()).0.is_some())
    };
    assert_eq!(run(None), [true, true]);
    assert_eq!(run(Some([1e4, 1e4])), [true, true]);
    assert_eq!(run(Some([40.0, 1e4])), [true, false]);
}
