//! Limits of the motors: each anti-windup against a plain simulation that shares no code with the arm's.

use pendularm::math::arm::{Arm, State};
use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation};

/// Accelerations of two links of 1 m and 1 kg, from the mass matrix of the textbook.
pub(crate) fn textbook(q: [f64; 2], v: [f64; 2], effort: [f64; 2]) -> [f64; 2] {
    let (c2, s2) = (q[1].cos(), q[1].sin());
    let (m11, m12, m22) = (5.0 / 3.0 + c2, 1.0 / 3.0 + c2 / 2.0, 1.0 / 3.0);
    let outer = 9.81 * (q[0] + q[1]).cos() / 2.0;
    let b1 = effort[0] + s2 * (v[0] * v[1] + v[1] * v[1] / 2.0) - 1.5 * 9.81 * q[0].cos() - outer;
    let b2 = effort[1] - s2 * v[0] * v[0] / 2.0 - outer;
    let det = m11 * m22 - m12 * m12;
    [(m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det]
}

/// One step of Runge-Kutta 4 under constant efforts and the viscous friction of each joint.
pub(crate) fn rk4(
    (q, v): ([f64; 2], [f64; 2]),
    effort: [f64; 2],
    viscous: [f64; 2],
    h: f64,
) -> ([f64; 2], [f64; 2]) {
    let along = |x: [f64; 2], h: f64, d: [f64; 2]| [x[0] + h * d[0], x[1] + h * d[1]];
    let a = |q, v: [f64; 2]| {
        let friction = [effort[0] - viscous[0] * v[0], effort[1] - viscous[1] * v[1]];
        textbook(q, v, friction)
    };
    let a1 = a(q, v);
    let (q2, v2) = (along(q, h / 2.0, v), along(v, h / 2.0, a1));
    let a2 = a(q2, v2);
    let (q3, v3) = (along(q, h / 2.0, v2), along(v, h / 2.0, a2));
    let a3 = a(q3, v3);
    let (q4, v4) = (along(q, h, v3), along(v, h, a3));
    let a4 = a(q4, v4);
    let sum = |x: [f64; 2], k: [[f64; 2]; 4]| {
        std::array::from_fn(|i| {
            x[i] + h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i])
        })
    };
    (sum(q, [v, v2, v3, v4]), sum(v, [a1, a2, a3, a4]))
}

const LIMIT: [f64; 2] = [40.0, 15.0];
const TRACKING_TIME: f64 = 0.1;
const H: f64 = 0.001;

/// The angles of joint 1 in a move from 0 to 0.6 rad, one per step, by the plain simulation.
fn plain(anti_windup: AntiWindup, every: usize, duration: f64) -> Vec<f64> {
    let gains = Gains::<2>::default();
    let dt = every as f64 * H;
    let (mut state, mut integral, mut effort) = (START, [0.0_f64; 2], [0.0; 2]);
    let mut angles = Vec::new();
    for step in 0..(duration / H) as usize {
        if step % every == 0 {
            for i in 0..2 {
                let e = TARGET[i] - state.0[i];
                let tau = |integral: f64| {
                    gains.kp[i] * e + gains.ki[i] * integral - gains.kd[i] * state.1[i]
                };
                let next = integral[i] + e * dt;
                let wanted = tau(next);
                let given = wanted.max(-LIMIT[i]).min(LIMIT[i]);
                let is_limited = wanted != given;
                integral[i] = match anti_windup {
                    AntiWindup::Clamp => next.clamp(-50.0, 50.0),
                    AntiWindup::Conditional if is_limited && (e > 0.0) == (wanted > 0.0) => {
                        integral[i]
                    }
                    AntiWindup::None | AntiWindup::Conditional => next,
                    AntiWindup::BackCalculation => {
                        next + dt / TRACKING_TIME * (given - wanted) / gains.ki[i]
                    }
                };
                effort[i] = match anti_windup {
                    AntiWindup::Conditional => tau(integral[i]).max(-LIMIT[i]).min(LIMIT[i]),
                    _ => given,
                };
            }
        }
        state = rk4(state, effort, [0.0; 2], H);
        angles.push(state.0[0]);
    }
    angles
}

const START: ([f64; 2], [f64; 2]) = ([0.0; 2], [0.0; 2]);
const TARGET: [f64; 2] = [0.6, 0.0];

fn limited(anti_windup: AntiWindup, every: usize) -> Simulation<2> {
    let mut arm = Simulation::new(Arm::default(), Gains::default());
    arm.set_state(State {
        position: START.0,
        velocity: START.1,
    });
    arm.set_setpoint(Setpoint::at(TARGET));
    arm.set_control_period(ControlPeriod {
        period: every as f64 * H,
        ..ControlPeriod::default()
    });
    arm.set_limits(Limits {
        effort: Some(LIMIT),
        anti_windup,
        tracking_time: TRACKING_TIME,
    });
    arm.enable(true);
    arm
}

/// The overshoot \[rad\], and the time after which joint 1 stays within 0.02 rad \[s\].
fn overshoot_and_settling(angles: &[f64]) -> (f64, f64) {
    let overshoot = angles.iter().fold(f64::MIN, |most, q| most.max(*q)) - TARGET[0];
    let outside = angles.iter().rposition(|q| (q - TARGET[0]).abs() > 0.02);
    (overshoot, (outside.unwrap() + 1) as f64 * H)
}

#[test]
fn overshoot_and_settling_of_every_anti_windup_are_those_of_a_plain_simulation() {
    for every in [1, 3] {
        let found = AntiWindup::ALL.map(|anti_windup| {
            let mut arm = limited(anti_windup, every);
            let angles = plain(anti_windup, every, 4.0);
            let mut ours = Vec::new();
            for (step, angle) in angles.iter().enumerate() {
                assert!(arm.step());
                let off = (arm.state().position[0] - angle).abs();
                assert!(off < 1e-9, "{anti_windup:?} at step {step}: {off}");
                ours.push(arm.state().position[0]);
            }
            assert_eq!(
                overshoot_and_settling(&ours).1,
                overshoot_and_settling(&angles).1
            );
            overshoot_and_settling(&ours)
        });
        // The bound of the integral is far away, so it does not help.
        let [clamp, none, conditional, back_calculation] = found;
        assert_eq!(clamp, none);
        for (worse, better) in [(none, conditional), (conditional, back_calculation)] {
            assert!(better.0 < 0.3 * worse.0, "{better:?} against {worse:?}");
            assert!(better.1 < worse.1, "{better:?} against {worse:?}");
        }
    }
}

#[test]
fn every_source_of_an_effort_is_limited_and_a_push_is_not() {
    let mut arm = limited(AntiWindup::Clamp, 1);
    arm.step();
    assert_eq!(*arm.effort(), [40.0, 0.0]);
    assert_eq!(arm.at_limit(), [true, false]);
    arm.drive(Some([-100.0, 3.0]));
    arm.step();
    assert_eq!(
        (*arm.effort(), arm.at_limit()),
        ([-40.0, 3.0], [true, false])
    );
    arm.drive(None);
    arm.enable(false);
    arm.set_command([1e6, -20.0]);
    arm.step();
    assert_eq!((*arm.effort(), arm.at_limit()), ([40.0, -15.0], [true; 2]));
    arm.disturb([5.0, -5.0], H);
    arm.step();
    assert_eq!(*arm.effort(), [45.0, -20.0]);
}

#[test]
fn a_joint_without_a_motor_has_no_effort_and_no_sign() {
    let mut arm = Simulation::<2>::new(Arm::default(), Gains::default());
    arm.set_limits(Limits {
        effort: Some([0.0, 5.0]),
        ..Limits::default()
    });
    for command in [[7.0, -7.0], [-7.0, 7.0]] {
        arm.set_command(command);
        arm.step();
        assert_eq!(arm.effort()[0].to_bits(), 0);
        assert_eq!(arm.at_limit(), [false, true]);
    }
}

#[test]
fn a_new_limit_bounds_an_effort_that_is_held_already() {
    let mut arm = limited(AntiWindup::Conditional, 50);
    arm.advance(10);
    assert_eq!(arm.effort()[0], 40.0);
    let integral = *arm.pid().integral();
    arm.set_limits(Limits {
        effort: Some([30.0, 15.0]),
        ..*arm.limits()
    });
    arm.step();
    assert_eq!((arm.effort()[0], *arm.pid().integral()), (30.0, integral));
    // A higher one counts from the next run of the law.
    arm.set_limits(Limits {
        effort: None,
        ..*arm.limits()
    });
    arm.advance(39);
    assert_eq!(arm.effort()[0], 40.0);
    arm.step();
    assert!(arm.effort()[0] > 40.0);
}

#[test]
fn with_a_delay_the_limited_effort_is_applied_a_period_later() {
    let mut arm = limited(AntiWindup::BackCalculation, 10);
    let delay = ControlPeriod {
        delay: 1,
        ..arm.control_period()
    };
    arm.set_control_period(delay);
    arm.advance(10);
    assert_eq!((*arm.effort(), arm.at_limit()), ([0.0; 2], [false; 2]));
    arm.step();
    assert_eq!((arm.effort()[0], arm.at_limit()), (40.0, [true, false]));
}

#[test]
fn switching_on_starts_without_an_integral_and_within_the_limit() {
    let mut arm = limited(AntiWindup::None, 1);
    arm.advance(300);
    assert!(arm.pid().integral()[0] > 0.05);
    arm.enable(false);
    assert_eq!(*arm.effort(), [0.0; 2]);
    arm.advance(5);
    arm.enable(true);
    arm.set_setpoint(Setpoint::at([3.0, 0.0]));
    let error = 3.0 - arm.state().position[0];
    arm.step();
    assert_eq!(arm.pid().integral()[0], error * H);
    assert_eq!(arm.effort()[0], 40.0);
    assert_eq!(arm.limits().effort, Some(LIMIT));
    arm.reset();
    assert_eq!(arm.limits().anti_windup, AntiWindup::None);
}

/// A tracking time below the control period removes the whole excess, and not more.
#[test]
fn a_short_tracking_time_counts_as_the_control_period() {
    let mut arm = limited(AntiWindup::BackCalculation, 10);
    arm.set_limits(Limits {
        tracking_time: 1e-9,
        ..*arm.limits()
    });
    arm.step();
    let Gains { kp, ki, .. } = *arm.pid().gains();
    let error = TARGET[0] - START.0[0];
    let demanded = kp[0] * error + ki[0] * arm.pid().integral()[0];
    assert!((demanded - LIMIT[0]).abs() < 1e-9, "{demanded}");
}
