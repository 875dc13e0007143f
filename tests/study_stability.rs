//! The largest stable timestep, predicted by linearisation: against 50-digit values, against closed forms, and against what
//! the arm itself does.

#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that panics has failed; it prints the worst it saw"
)]

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::measure::Setting;
use pendularm::study::stability::{Sampling, largest_timestep, limit_held, limits, step_matrix};
use serde::Deserialize;

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
    let oracle: Oracle = serde_json::from_str(include_str!("data/stability.json")).unwrap();
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

/// Of an oscillator at ω = 1 the state is `(x, v)`, as the stored matrices have it. Entries are sums of terms `(h λ)^k / k!`
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
    let rest = equilibrium(&arm, &gains, &setpoint);
    for i in 0..N {
        let error = (rest.position[i] - case.equilibrium[i]).abs();
        assert!(
            error < 1e-14,
            "{} {}: {error:e}",
            case.configuration,
            case.gains
        );
    }
    let linear = Linear::at(&arm, &gains, &rest.position, &rest.integrating);
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

#[test]
fn tmp_limits() {
    let t = std::time::Instant::now();
    for m in Method::ALL {
        let t = std::time::Instant::now();
        println!(
            "{m} {:?} {:?}",
            limits(
                &Arm::<2>::default(),
                &Gains::default(),
                &Setpoint::default(),
                m
            ),
            t.elapsed()
        );
        let t = std::time::Instant::now();
        println!(
            "{m} {:?} {:?}",
            limits(
                &Arm::<3>::default(),
                &Gains::default(),
                &Setpoint::default(),
                m
            ),
            t.elapsed()
        );
        let t = std::time::Instant::now();
        println!(
            "{m} {:?} {:?}",
            limit_held(
                &Arm::<3>::default(),
                &Gains::default(),
                &Setpoint::default(),
                m
            ),
            t.elapsed()
        );
        let free = pendularm::study::linear::no_control();
        println!(
            "{m} {:?} {:?}",
            limits(&Arm::<3>::default(), &free, &Setpoint::default(), m),
            t.elapsed()
        );
        let none = Arm::new([1.0; 3], [1.0; 3], 0.0).unwrap();
        println!(
            "{m} {:?} {:?}",
            limits(&none, &free, &Setpoint::default(), m),
            t.elapsed()
        );
    }
    println!("{:?}", t.elapsed());
}

/// Gains of three kinds, as the stored cases have them, and a full controller.
const KINDS: [(&str, f64, f64, f64); 4] = [
    ("mild", 50.0, 0.0, 10.0),
    ("stiff", 1e4, 0.0, 1e2),
    ("overdamped", 1e2, 0.0, 1e4),
    ("integral", 1e3, 2e3, 1e2),
];

fn measure_all<const N: usize>(pose: [f64; N]) -> f64 {
    let mut worst: f64 = 0.0;
    for (kind, kp, ki, kd) in KINDS {
        let setting = |method, sampling| Setting {
            arm: Arm::default(),
            gains: Gains {
                kp: [kp; N],
                ki: [ki; N],
                kd: [kd; N],
            },
            setpoint: Setpoint {
                position: pose,
                velocity: [0.0; N],
            },
            method,
            sampling,
        };
        for method in Method::ALL {
            for sampling in Sampling::ALL {
                let setting = setting(method, sampling);
                let linear = Linear::at_setpoint(&setting.arm, &setting.gains, &setting.setpoint);
                let predicted = largest_timestep(&linear, method, sampling).unwrap();
                let measured = setting.measured_limit(0.9 * predicted).unwrap();
                let error = (measured / predicted - 1.0).abs();
                println!(
                    "{N} {kind} {method} {}: {measured:.5e} measured, {predicted:.5e} predicted, {error:.1e}",
                    sampling.name()
                );
                worst = worst.max(error);
            }
        }
    }
    worst
}

#[test]
fn the_arm_itself_has_the_limits_that_are_predicted() {
    let worst = measure_all([0.5, 0.8]).max(measure_all([0.5, 0.8, -0.6]));
    println!("worst {worst:e}");
    assert!(worst < 0.01);
}
