//! The largest stable timestep, predicted by linearisation: against 50-digit values and closed forms.
//! `properties/limits.rs` and the report's scenes have runs of the arm.

use std::f64::consts::FRAC_PI_2;

use pendularm::math::arm::Arm;
use pendularm::math::dynamics::mass_matrix;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::stability::{Rest, Sampling, Stepping, largest_timestep, limit_held, limits};
use serde_json::Value;

use crate::equilibrium::residual;
use crate::stored::{arm, array, entries, for_links, gains, list, method, number};

/// The stored cases of a type: oscillators `ẍ = -ω² x - 2 z ω ẋ` at ω = 1, and arms under proportional and derivative
/// control.
fn stored(kind: &str) -> Vec<Value> {
    let mut cases = entries(include_str!("../data/stability.json"), "cases");
    cases.retain(|case| case["type"] == kind);
    assert!(!cases.is_empty());
    cases
}

/// Growth counts from 1e-11 of the fastest eigenvalue on, which at a damping ratio of 0.01 is 1e-9 of the timestep. Where
/// two eigenvalues meet on the circle (z = 0, 1/2, 1) half of their digits are lost.
#[test]
fn the_limit_of_an_oscillator_is_the_stored_one() {
    for case in stored("linear") {
        let (method, z, expected) = (method(&case), number(&case["z"]), number(&case["h_max"]));
        let oscillator = Linear::oscillator(1.0, 0.0, 0.0, 2.0 * z);
        let limit = largest_timestep(&oscillator, method, Sampling::Continuous).unwrap();
        let is_double = [0.0, 0.5, 1.0].contains(&z);
        let tolerance = if is_double { 5e-8 } else { 1e-9 };
        let scale = if expected == 0.0 { 1.0 } else { expected };
        assert!(
            (limit - expected).abs() < tolerance * scale,
            "{method} z {z}"
        );
    }
}

fn check_arm<const N: usize>(case: &Value) {
    let gains = gains(array(&case["kp"]), [0.0; N], array(&case["kd"]));
    let control = ControlLoop::new(arm(case), gains, Setpoint::at(array(&case["setpoint"])));
    let rest = equilibrium(&control);
    let told = format!("{N} {} {}", case["configuration"], case["gains"]);
    for (angle, expected) in rest.position.iter().zip(list(&case["equilibrium"])) {
        assert!((angle - expected).abs() < 1e-14, "{told}: {angle}");
    }
    let linear = Linear::at(&control, &rest.position, &rest.integrating);
    for expected in case["methods"].as_array().unwrap() {
        let sampling = match expected["control"].as_str().unwrap() {
            "zoh" => Sampling::Held,
            "continuous" => Sampling::Continuous,
            other => panic!("what is {other}?"),
        };
        let limit = largest_timestep(&linear, method(expected), sampling).unwrap();
        let error = (limit / number(&expected["dt_max"]) - 1.0).abs();
        assert!(
            error < 1e-10,
            "{told} {expected}: {limit:e}, off by {error:e}"
        );
    }
}

/// Same linearisation, same step matrices, in double precision: far closer than the 1 % that matters. Growth counts from
/// 1e-11 on.
#[test]
fn the_limits_of_the_arm_are_the_stored_ones() {
    for case in stored("arm") {
        for_links!(case, check_arm(&case));
    }
}

/// Sampled control on a single inertia, in the shipped order (the integral takes up the error before it is used): a
/// period by hand, of one exact step or of two of Euler.
#[test]
fn the_held_law_is_stepped_in_the_shipped_order() {
    let (kp, ki, kd, h) = (30.0, 40.0, 7.0, 0.05);
    let inertia = Linear::oscillator(0.0, kp, ki, kd);
    for (method, substeps, pushed) in [(Method::Rk4, 1, 0.5), (Method::Euler, 2, 0.25)] {
        let matrix = Stepping::held(&inertia, method, substeps, 0).matrix(h);
        for start in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let [x, v, s]: [f64; 3] = start;
            let s = s - h * x;
            let u = -kp * x - kd * v + ki * s;
            let expected = [x + h * v + pushed * h * h * u, v + h * u, s];
            for (row, expected) in expected.into_iter().enumerate() {
                let products = (0..3).map(|column| matrix[(row, column)] * start[column]);
                let found: f64 = products.sum();
                // Three products of at most 2.
                assert!((found - expected).abs() < 1e-15, "{start:?} {row}");
            }
        }
    }
}

/// With an integral at every joint the arm rests at the setpoint, as long as the integral can carry the load.
#[test]
fn an_integral_holds_the_setpoint_and_a_weak_one_does_not() {
    let control = |ki| {
        let gains = gains([100.0; 2], [ki; 2], [10.0; 2]);
        ControlLoop::new(Arm::default(), gains, Setpoint::default())
    };
    let rest = equilibrium(&control(10.0));
    assert_eq!((rest.position, rest.integrating), ([0.0; 2], [true; 2]));
    // Horizontal: 1.5 + 0.5 times m g l at the shoulder, half of m g l at the elbow.
    assert!((rest.integral[0] - 1.962).abs() < 1e-12 && (rest.integral[1] - 0.4905).abs() < 1e-12);
    // 19.62 N m is beyond 0.1 times 50 rad s: that joint sags under what is left, the other one still holds.
    let weak = control(0.1);
    let rest = equilibrium(&weak);
    assert_eq!((rest.integral[0], rest.integrating), (50.0, [false, true]));
    assert!(rest.position[0] < -0.1 && rest.position[1] == 0.0);
    let residual = residual(&weak, &rest);
    assert!(residual < 1e-12, "{residual:e}");
}

#[test]
fn the_advised_timestep_is_a_part_of_the_smallest_over_poses() {
    for method in Method::ALL {
        let control = ControlLoop::new(Arm::<2>::default(), Gains::default(), Setpoint::default())
            .with_method(method);
        let limits = limits(&control);
        let (held, minimum) = (limits.held.unwrap(), limits.minimum_held.unwrap());
        assert!(minimum <= held);
        assert!(limits.minimum_continuous <= limits.continuous);
        assert_eq!(limits.advised, Some(0.8 * minimum));
    }
}

/// Undamped, a free arm is unstable under Euler and midpoint, and limited by its fastest swing under the others; without
/// gravity nothing is left that could be unstable.
#[test]
fn a_free_arm_has_the_limits_of_its_swing() {
    let swing = |method| limits(&ControlLoop::free(Arm::<3>::default()).with_method(method));
    for method in [Method::Euler, Method::Midpoint] {
        let found = swing(method);
        assert_eq!([found.held, found.minimum_held], [Some(0.0); 2]);
    }
    // 2 and 2 sqrt 2 per fastest mode: the same ratio for every mode. Growth counts from 1e-11 on.
    let (verlet, rk4) = (swing(Method::Verlet), swing(Method::Rk4));
    let ratio = rk4.held.unwrap() / verlet.held.unwrap();
    assert!((ratio - 2.0_f64.sqrt()).abs() < 1e-6, "{ratio}");
    assert_eq!(verlet.held, verlet.continuous);
    for method in Method::ALL {
        let weightless = ControlLoop::free(Arm::<3>::default().weightless());
        let found = limits(&weightless.with_method(method));
        assert_eq!([found.held, found.minimum_held, found.advised], [None; 3]);
    }
}

/// A joint without gains and without gravity only drifts. The limit is that of the other joints.
#[test]
fn a_joint_that_drifts_is_not_unstable() {
    let found = |outer: f64, method| {
        let gains = gains([100.0, 0.0], [0.0; 2], [10.0, 0.0]);
        let setpoint = Setpoint {
            position: [0.0, outer],
            velocity: [0.0; 2],
        };
        let control = ControlLoop::new(Arm::<2>::default().weightless(), gains, setpoint);
        limits(&control.with_method(method))
    };
    for method in Method::ALL {
        for k in -15..=15 {
            let found = found(0.2 * f64::from(k), method);
            for limit in [found.held, found.minimum_held, found.advised] {
                assert!(limit.unwrap() > 0.07, "{method:?}, {k}: {found:?}");
            }
        }
    }
}

/// For all settings of a client a limit is either absent or a number that is not negative.
#[test]
fn no_parameters_make_a_limit_that_is_no_number() {
    let sizes = [1e-160, 1e-6, 1.0, 1e9, 1e160];
    let gains = [0.0, 1e-300, 1.0, 1e9, 1e300];
    for (k, length) in sizes.into_iter().enumerate() {
        for (m, gain) in gains.into_iter().enumerate() {
            let arm =
                Arm::new([length, 1.0, sizes[m]], [1.0, sizes[4 - k], 1.0], gains[k]).unwrap();
            let gains = crate::stored::gains([gain; 3], [gains[k]; 3], [gains[4 - m], 1.0, 0.0]);
            let setpoint = Setpoint {
                position: [1e300, -gain, 1.0],
                velocity: [gain, 0.0, 1.0],
            };
            for method in [Method::Euler, Method::Rk4] {
                let limits = limits(&ControlLoop::new(arm, gains, setpoint).with_method(method));
                let minima = [limits.minimum_held, limits.minimum_continuous];
                for limit in minima.into_iter().chain([limits.held, limits.continuous]) {
                    assert!(limit.is_none_or(|limit| limit >= 0.0), "{limits:?}");
                }
            }
        }
    }
}

/// A joint with an integral that is too strong for its damping diverges at some 1.3/s. The damping of the other joint
/// makes a rate of 1e12/s, and rounding at that rate must not hide the slow growth.
#[test]
fn slow_growth_beside_a_joint_of_enormous_damping_is_seen() {
    let arm = Arm::<2>::default();
    for (kd, bend) in [(1e9, 0.0), (1e11, 0.0), (1e11, 0.9), (1e13, 1.7)] {
        for (part, runs_away) in [(0.8, false), (0.99, false), (1.01, true), (1.6, true)] {
            for method in Method::ALL {
                check_braked(&arm, ([20.0, kd], 1.0), bend, part, method, runs_away);
            }
        }
    }
    // Without an integral the elbow creeps, at 1e-11/s, and hides nothing either.
    for (part, runs_away) in [(0.8, false), (0.99, false), (1.01, true), (1.6, true)] {
        check_braked(&arm, ([20.0, 1e13], 0.0), 0.0, part, Method::Rk4, runs_away);
    }
    let mut rng = fastrand::Rng::with_seed(72);
    let mut size = |decades: f64| 10_f64.powf(decades * (2.0 * rng.f64() - 1.0));
    for case in 0..100 {
        let arm = Arm::new([size(0.5), size(0.5)], [size(0.5), size(0.5)], 9.81).unwrap();
        let (damping, brake) = (20.0 * size(0.5), 1e11 * size(2.0));
        let (bend, runs_away) = (size(1.0), case % 2 == 0);
        let part = if runs_away { 1.1 } else { 0.9 };
        let method = Method::ALL[case % Method::ALL.len()];
        let kd = [damping, brake];
        check_braked(&arm, (kd, 1.0), bend, part, method, runs_away);
    }
}

/// A hanging arm with its elbow bent and braked, and `part` of the largest stable integral gain at the shoulder. The
/// elbow has the integral gain `elbow`. As the elbow does not move, `J s³ + kd s² + (kp + G') s + ki` is stable as far
/// as `kd (kp + G') > J ki`.
fn check_braked(
    arm: &Arm<2>,
    (kd, elbow): ([f64; 2], f64),
    bend: f64,
    part: f64,
    method: Method,
    runs_away: bool,
) {
    let pose = [-FRAC_PI_2, bend];
    let inertia = mass_matrix(arm, &pose)[0][0];
    let ([l1, l2], [m1, m2]) = (*arm.lengths(), *arm.masses());
    let weight = arm.gravity() * ((0.5 * m1 + m2) * l1 + 0.5 * m2 * l2 * f64::cos(bend));
    let ki = [part * kd[0] * (100.0 + weight) / inertia, elbow];
    let gains = gains([100.0; 2], ki, kd);
    let control = ControlLoop::new(*arm, gains, Setpoint::at(pose)).with_method(method);
    let found = limits(&control);
    let told = format!("{part}: {found:?} {bend} {gains:?} {arm:?}");
    assert_eq!(found.held == Some(0.0), runs_away, "{told}");
    assert_eq!(found.rest == Rest::Unstable, runs_away, "{told}");
    assert_eq!(limit_held(&control) == Some(0.0), runs_away, "{told}");
}
