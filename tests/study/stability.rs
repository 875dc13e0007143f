//! The largest stable timestep, predicted by linearisation: against 50-digit values, closed forms, and the growth per control
//! period. `properties/limits.rs` has runs of the arm.

use std::f64::consts::FRAC_PI_2;

use pendularm::math::arm::Arm;
use pendularm::math::dynamics::mass_matrix;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::measure::growth_per_period;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::stability::{
    Rest, Sampling, Stepping, largest_timestep, limit_held, limits, step_matrix,
};
use serde::Deserialize;

use crate::equilibrium::residual;

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Case {
    Linear(LinearCase),
    Arm(ArmCase),
}

/// `ẍ = -ω² x - 2 z ω ẋ` at ω = 1.
#[derive(Deserialize)]
struct LinearCase {
    method: String,
    z: f64,
    h_max: f64,
    samples: Vec<Sample>,
}

#[derive(Deserialize)]
struct Sample {
    h: f64,
    #[serde(rename = "A")]
    matrix: [[f64; 2]; 2],
    rho: f64,
}

/// An arm under proportional and derivative control.
#[derive(Deserialize)]
struct ArmCase {
    n: usize,
    configuration: String,
    gains: String,
    masses: Vec<f64>,
    lengths: Vec<f64>,
    gravity: f64,
    kp: Vec<f64>,
    kd: Vec<f64>,
    setpoint: Vec<f64>,
    equilibrium: Vec<f64>,
    methods: Vec<MethodCase>,
}

#[derive(Deserialize)]
struct MethodCase {
    control: String,
    method: String,
    dt_max: f64,
}

fn oracle() -> Vec<Case> {
    let oracle: Oracle = serde_json::from_str(include_str!("../data/stability.json")).unwrap();
    oracle.cases
}

fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    values.try_into().unwrap()
}

impl ArmCase {
    fn parts<const N: usize>(&self) -> (Arm<N>, Gains<N>, Setpoint<N>) {
        let arm = Arm::new(array(&self.lengths), array(&self.masses), self.gravity).unwrap();
        let gains = Gains {
            kp: array(&self.kp),
            ki: [0.0; N],
            kd: array(&self.kd),
        };
        let setpoint = Setpoint {
            position: array(&self.setpoint),
            velocity: [0.0; N],
        };
        (arm, gains, setpoint)
    }
}

/// For an oscillator at ω = 1 the state is `(x, v)`, as the stored matrices have it. Entries are sums of terms `(h λ)^k / k!`
/// with `λ <= 1 + 2 z`, each a few times rounded.
#[test]
fn the_step_matrix_of_an_oscillator_is_the_stored_one() {
    for case in oracle() {
        let Case::Linear(case) = case else { continue };
        let method: Method = case.method.parse().unwrap();
        let oscillator = Linear::oscillator(1.0, 0.0, 0.0, 2.0 * case.z);
        for sample in &case.samples {
            let matrix = step_matrix(&oscillator, method, Sampling::Continuous, sample.h);
            let size = sample.h * (1.0 + 2.0 * case.z);
            let scale = 1.0 + size * (1.0 + size * (0.5 + size * (1.0 / 6.0 + size / 24.0)));
            for row in 0..2 {
                for column in 0..2 {
                    let error = (matrix[(row, column)] - sample.matrix[row][column]).abs();
                    assert!(
                        error < 4e-16 * scale,
                        "{method} z {} h {}",
                        case.z,
                        sample.h
                    );
                }
            }
            // A double eigenvalue keeps half of the digits.
            let error = (matrix.spectral_radius() - sample.rho).abs();
            assert!(error < 1e-7 * scale, "{method} z {} h {}", case.z, sample.h);
        }
    }
}

/// Growth counts from 1e-11 of the fastest eigenvalue on, which at a damping ratio of 0.01 is 1e-9 of the timestep. Where
/// two eigenvalues meet on the circle (z = 0, 1/2, 1) half of their digits are lost.
#[test]
fn the_limit_of_an_oscillator_is_the_stored_one() {
    let mut worst: f64 = 0.0;
    for case in oracle() {
        let Case::Linear(case) = case else { continue };
        let method: Method = case.method.parse().unwrap();
        let oscillator = Linear::oscillator(1.0, 0.0, 0.0, 2.0 * case.z);
        let limit = largest_timestep(&oscillator, method, Sampling::Continuous).unwrap();
        let error = if case.h_max == 0.0 {
            limit
        } else {
            (limit / case.h_max - 1.0).abs()
        };
        let double = [0.0, 0.5, 1.0].contains(&case.z);
        assert!(error < if double { 5e-8 } else { 1e-9 });
        worst = worst.max(error);
    }
    println!("worst {worst:e}");
}

fn check_arm<const N: usize>(case: &ArmCase, worst: &mut f64) {
    let (arm, gains, setpoint) = case.parts::<N>();
    let control = ControlLoop::new(arm, gains, setpoint);
    let rest = equilibrium(&control);
    for i in 0..N {
        let error = (rest.position[i] - case.equilibrium[i]).abs();
        assert!(
            error < 1e-14,
            "{} {}: {error:e}",
            case.configuration,
            case.gains
        );
    }
    let linear = Linear::at(&control, &rest.position, &rest.integrating);
    for expected in &case.methods {
        let method: Method = expected.method.parse().unwrap();
        let sampling = match expected.control.as_str() {
            "zoh" => Sampling::Held,
            "continuous" => Sampling::Continuous,
            other => panic!("what is {other}?"),
        };
        let limit = largest_timestep(&linear, method, sampling).unwrap();
        let error = (limit / expected.dt_max - 1.0).abs();
        if error > 1e-9 {
            println!(
                "{N} {} {} {method} {}: {limit:e} for {:e}, off by {error:e}",
                case.configuration, case.gains, expected.control, expected.dt_max
            );
        }
        *worst = worst.max(error);
    }
}

/// Same linearisation, same step matrices, in double precision: far closer than the 1 % that matters. Growth counts from
/// 1e-11 on.
#[test]
fn the_limits_of_the_arm_are_the_stored_ones() {
    let mut worst: f64 = 0.0;
    for case in oracle() {
        let Case::Arm(case) = case else { continue };
        match case.n {
            2 => check_arm::<2>(&case, &mut worst),
            3 => check_arm::<3>(&case, &mut worst),
            n => panic!("{n} links?"),
        }
    }
    println!("worst {worst:e}");
    assert!(worst < 1e-10);
}

/// Sampled control on a single inertia, in the shipped order (the integral takes up the error before it is used), with the
/// exact plant that Runge-Kutta 4 is under a constant effort: two periods by hand.
#[test]
fn the_held_law_is_stepped_in_the_shipped_order() {
    let (kp, ki, kd, h) = (30.0, 40.0, 7.0, 0.05);
    let matrix = step_matrix(
        &Linear::oscillator(0.0, kp, ki, kd),
        Method::Rk4,
        Sampling::Held,
        h,
    );
    for start in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        let [x, v, s]: [f64; 3] = start;
        let s = s - h * x;
        let u = -kp * x - kd * v + ki * s;
        let expected = [x + h * v + 0.5 * h * h * u, v + h * u, s];
        for (row, expected) in expected.into_iter().enumerate() {
            let found: f64 = (0..3)
                .map(|column| matrix[(row, column)] * start[column])
                .sum();
            // Three products of at most 2.
            assert!((found - expected).abs() < 1e-15, "{start:?} {row}");
        }
    }
}

/// With an integral at every joint the arm rests at the setpoint, as long as the integral can carry the load.
#[test]
fn an_integral_holds_the_setpoint_and_a_weak_one_does_not() {
    let setpoint = Setpoint {
        position: [0.0, 0.0],
        velocity: [0.0; 2],
    };
    let gains = |ki| Gains {
        kp: [100.0; 2],
        ki: [ki; 2],
        kd: [10.0; 2],
    };
    let arm = Arm::default();
    let rest = equilibrium(&ControlLoop::new(arm, gains(10.0), setpoint));
    assert_eq!((rest.position, rest.integrating), ([0.0; 2], [true; 2]));
    // Horizontal: 1.5 + 0.5 times m g l at the shoulder, half of m g l at the elbow.
    assert!((rest.integral[0] - 1.962).abs() < 1e-12 && (rest.integral[1] - 0.4905).abs() < 1e-12);
    // 19.62 N m is beyond 0.1 times 50 rad s: that joint sags under what is left, the other one still holds.
    let weak = ControlLoop::new(arm, gains(0.1), setpoint);
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
        let alone = limit_held(&control);
        assert_eq!(alone, limits.held);
        // The default gains are chosen to be stable up to 3 ms in every pose.
        assert!(minimum > 0.003);
    }
}

/// Undamped, a free arm is unstable under Euler and midpoint, and limited by its fastest swing under the others; without
/// gravity nothing is left that could be unstable.
#[test]
fn a_free_arm_has_the_limits_of_its_swing() {
    let swing = |method| limits(&ControlLoop::free(Arm::<3>::default()).with_method(method));
    for method in [Method::Euler, Method::Midpoint] {
        assert_eq!(
            (swing(method).held, swing(method).minimum_held),
            (Some(0.0), Some(0.0))
        );
    }
    // 2 and 2 sqrt 2 per fastest mode: the same ratio for every mode. Growth counts from 1e-11 on.
    let (verlet, rk4) = (swing(Method::Verlet), swing(Method::Rk4));
    let ratio = rk4.held.unwrap() / verlet.held.unwrap();
    assert!((ratio - 2.0_f64.sqrt()).abs() < 1e-6, "{ratio}");
    assert_eq!(verlet.held, verlet.continuous);
    let weightless = Arm::new([1.0; 3], [1.0; 3], 0.0).unwrap();
    for method in Method::ALL {
        let limits = limits(&ControlLoop::free(weightless).with_method(method));
        assert_eq!(
            (limits.held, limits.minimum_held, limits.advised),
            (None, None, None)
        );
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
            let gains = Gains {
                kp: [gain; 3],
                ki: [gains[k]; 3],
                kd: [gains[4 - m], 1.0, 0.0],
            };
            let setpoint = Setpoint {
                position: [1e300, -gain, 1.0],
                velocity: [gain, 0.0, 1.0],
            };
            for method in [Method::Euler, Method::Rk4] {
                let limits = limits(&ControlLoop::new(arm, gains, setpoint).with_method(method));
                for limit in [
                    limits.held,
                    limits.continuous,
                    limits.minimum_held,
                    limits.minimum_continuous,
                ] {
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
    let gains = Gains {
        kp: [100.0; 2],
        ki: [part * kd[0] * (100.0 + weight) / inertia, elbow],
        kd,
    };
    let control = ControlLoop::new(*arm, gains, Setpoint::at(pose)).with_method(method);
    let found = limits(&control);
    let told = format!("{part}: {found:?} {bend} {gains:?} {arm:?}");
    assert_eq!(found.held == Some(0.0), runs_away, "{told}");
    assert_eq!(found.rest == Rest::Unstable, runs_away, "{told}");
    assert_eq!(limit_held(&control) == Some(0.0), runs_away, "{told}");
}

/// Far below the limit the integral decides, beyond it the delayed damping; both are measured.
#[test]
fn a_deviation_grows_per_control_period_as_the_spectral_radius_says() {
    for method in Method::ALL {
        let setpoint = Setpoint::at([0.4, 0.8]);
        let control =
            ControlLoop::new(Arm::default(), Gains::<2>::default(), setpoint).with_method(method);
        let linear = Linear::at_setpoint(&control);
        for substeps in [1, 10] {
            let stepping = Stepping::held(&linear, method, substeps, false);
            let limit = stepping.limit().unwrap();
            for part in [0.3, 0.9, 1.01, 1.05] {
                let period = part * limit;
                let predicted = stepping.matrix(period).spectral_radius();
                let measured = growth_per_period(&control.with_timestep(period), substeps).unwrap();
                // The ratio shows in the swing that is left over 4000 periods.
                assert!(
                    (measured / predicted - 1.0).abs() < 1e-3,
                    "{method}, {substeps} steps in {period} s: {measured}, {predicted}"
                );
                assert_eq!(measured < 1.0, part < 1.0, "{method}, {substeps}, {part}");
            }
        }
    }
}
