//! Sensors of the controller: every setting against a plain simulation, and what begins a measurement again.

use pendularm::math::arm::{Arm, State};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::sensors::{Sensors, VelocitySource};
use pendularm::math::simulation::{ControlPeriod, Simulation};

use crate::limits::rk4;

const H: f64 = 0.001;
/// Encoders of 12 and 10 bits.
const STEP: [f64; 2] = [
    std::f64::consts::TAU / 4096.0,
    std::f64::consts::TAU / 1024.0,
];
const TARGET: [f64; 2] = [0.6, -0.4];

fn measuring(sensors: Sensors<2>, every: u64, delay: u8) -> Simulation<2> {
    let mut arm = Simulation::new(Arm::default(), Gains::default());
    arm.set_setpoint(Setpoint::at(TARGET));
    arm.set_control_period(ControlPeriod {
        period: every as f64 * H,
        delay,
    });
    arm.set_sensors(sensors);
    arm.enable(true);
    arm
}

fn encoders(velocity: VelocitySource) -> Sensors<2> {
    Sensors {
        encoder_step: STEP,
        velocity,
    }
}

/// The states of a move after each step, by a plain simulation.
fn plain(sensors: Sensors<2>, every: u64, delay: usize, steps: u64) -> Vec<[f64; 2]> {
    let gains = Gains::<2>::default();
    let dt = every as f64 * H;
    let (mut state, mut integral) = (([0.0; 2], [0.0; 2]), [0.0; 2]);
    let (mut before, mut results): (Option<[f64; 2]>, Vec<[f64; 2]>) =
        (None, vec![[0.0; 2]; delay]);
    let mut positions = Vec::new();
    for step in 0..steps {
        if step % every == 0 {
            let (q, mut v): ([f64; 2], [f64; 2]) = state;
            let counted = std::array::from_fn(|i| match sensors.encoder_step[i] {
                0.0 => q[i],
                size => size * (q[i] / size).round(),
            });
            if sensors.velocity == VelocitySource::Difference {
                v = before.map_or([0.0; 2], |before| {
                    [0, 1].map(|i| (counted[i] - before[i]) / dt)
                });
            }
            before = Some(counted);
            let mut effort = [0.0; 2];
            for i in 0..2 {
                let e = TARGET[i] - counted[i];
                integral[i] += e * dt;
                effort[i] = gains.kp[i] * e + gains.ki[i] * integral[i] - gains.kd[i] * v[i];
            }
            results.push(effort);
        }
        let held = results[results.len() - 1 - delay];
        state = rk4(state, held, [0.0; 2], H);
        positions.push(state.0);
    }
    positions
}

#[test]
fn every_setting_moves_the_arm_as_a_plain_simulation_does() {
    let exact = Sensors::default();
    let differing = Sensors {
        velocity: VelocitySource::Difference,
        ..exact
    };
    for (sensors, every, delay) in [
        (exact, 1, 0),
        (exact, 1, 2),
        (exact, 2, 1),
        (exact, 1, 3),
        (differing, 1, 0),
        (differing, 2, 1),
        (encoders(VelocitySource::Exact), 1, 0),
        (encoders(VelocitySource::Difference), 2, 0),
        (encoders(VelocitySource::Difference), 1, 2),
    ] {
        let mut arm = measuring(sensors, every, delay);
        let expected = plain(sensors, every, usize::from(delay), 400);
        for (step, expected) in expected.iter().enumerate() {
            assert!(arm.step());
            for (i, q) in arm.state().position.iter().enumerate() {
                let told = format!("{sensors:?} {every} {delay}: joint {i} at step {step}");
                assert!((q - expected[i]).abs() < 1e-9, "{told}: {q} {expected:?}");
            }
        }
    }
}

#[test]
fn a_position_is_the_nearest_multiple_of_a_step_and_keeps_one_that_has_none() {
    let sensors = Sensors {
        encoder_step: [0.25, 5e-324],
        velocity: VelocitySource::Exact,
    };
    for (q, expected) in [(0.124, 0.0), (0.126, 0.25), (-0.126, -0.25), (7.0, 7.0)] {
        let state = State {
            position: [q, 1e300],
            velocity: [3.0, -4.0],
        };
        let measured = sensors.measured(&state, None, 0.01);
        assert_eq!(measured.position, [expected, 1e300]);
        assert_eq!(measured.velocity, [3.0, -4.0]);
    }
}

/// The last setting is the default again, and its steps are those of an arm that never had another one.
#[test]
fn switched_off_the_steps_are_those_without_sensors() {
    let mut arm = measuring(Sensors::default(), 0, 0);
    let mut other = measuring(encoders(VelocitySource::Difference), 0, 3);
    other.set_control_period(ControlPeriod::default());
    other.set_sensors(Sensors::default());
    assert_eq!(other, arm);
    other.advance(100);
    arm.advance(100);
    assert_eq!(other, arm);
}

#[test]
fn with_a_delay_the_first_efforts_are_zero_and_then_those_of_so_many_periods_before() {
    for delay in [1, 2, 5, 16] {
        let mut arm = measuring(Sensors::default(), 3, delay);
        let mut results = Vec::new();
        for period in 0..40 {
            let mut law = arm.pid().clone();
            let computed = law.control(arm.state(), 3.0 * H);
            law.commit(computed.integral);
            results.push(computed.effort);
            for _ in 0..3 {
                arm.step();
                let expected = match period - i32::from(delay) {
                    earlier @ 0.. => results[earlier as usize],
                    _ => [0.0; 2],
                };
                assert_eq!(*arm.effort(), expected, "delay {delay}, period {period}");
            }
        }
    }
}

/// An arm that turns at 1 rad/s, and whose law has measured it.
fn turning() -> Simulation<2> {
    let mut arm = Simulation::<2>::new(Arm::default().weightless(), Gains::default());
    arm.set_gains(Gains {
        kp: [0.0; 2],
        ki: [0.0; 2],
        kd: [0.0; 2],
    });
    arm.set_state(State {
        position: [0.0; 2],
        velocity: [1.0, 0.0],
    });
    arm.set_sensors(Sensors {
        velocity: VelocitySource::Difference,
        ..Sensors::default()
    });
    arm.set_control_period(ControlPeriod {
        period: 4.0 * H,
        delay: 0,
    });
    arm.enable(true);
    arm.advance(10);
    let speed = arm.measured().velocity[0];
    assert!((speed - 1.0).abs() < 1e-9, "{speed}");
    assert_eq!(
        arm.measured().position[0],
        arm.state().position[0] - 2.0 * H
    );
    arm
}

/// What the controller measures one step after each event, in an arm that turns at 1 rad/s.
#[test]
fn a_difference_begins_at_zero_after_everything_that_begins_it_again() {
    type Event = fn(&mut Simulation<2>);
    let events: [Event; 7] = [
        |arm| {
            arm.enable(false);
            arm.enable(true);
        },
        |arm| arm.set_state(*arm.state()),
        |arm| {
            arm.set_timestep(2.0 * H);
        },
        |arm| {
            arm.set_control_period(ControlPeriod {
                period: 5.0 * H,
                delay: 0,
            });
        },
        |arm| {
            arm.set_control_period(ControlPeriod {
                delay: 1,
                ..arm.control_period()
            });
        },
        |arm| {
            arm.set_sensors(Sensors {
                encoder_step: [1e-9; 2],
                ..*arm.sensors()
            });
        },
        |arm| {
            arm.drive(Some([0.0; 2]));
            arm.step();
            arm.drive(None);
        },
    ];
    for (index, event) in events.into_iter().enumerate() {
        let mut arm = turning();
        event(&mut arm);
        // What the first run would measure, and what it measures.
        assert_eq!(arm.measured().velocity, [0.0; 2], "event {index}");
        arm.step();
        assert_eq!(arm.measured().velocity, [0.0; 2], "event {index}");
        arm.advance(8);
        let speed = arm.measured().velocity[0];
        assert!((speed - 1.0).abs() < 1e-5, "event {index}: {speed}");
    }
    let mut arm = turning();
    arm.reset();
    arm.advance(10);
    assert_eq!(arm.measured(), State::rest());
    assert_eq!(arm.sensors().velocity, VelocitySource::Difference);
    // Limits and commands begin nothing.
    let mut arm = turning();
    arm.set_limits(*arm.limits());
    arm.set_setpoint(Setpoint::at([1.0; 2]));
    assert!(arm.measured().velocity[0] > 0.9);
}

/// With a new delay the latest result waits in every place.
#[test]
fn a_new_delay_keeps_the_latest_result() {
    let mut arm = measuring(Sensors::default(), 1, 1);
    arm.advance(20);
    let latest = arm.checkpoint().held.computed;
    arm.set_control_period(ControlPeriod {
        period: H,
        delay: 3,
    });
    for _ in 0..3 {
        arm.step();
        assert_eq!(*arm.effort(), latest);
    }
    arm.step();
    assert_ne!(*arm.effort(), latest);
    arm.set_control_period(ControlPeriod {
        period: H,
        delay: 2,
    });
    let latest = arm.checkpoint().held.computed;
    arm.step();
    assert_eq!(*arm.effort(), latest);
}
