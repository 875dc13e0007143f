//! The computation behind `/arm_sim/integration_step`: a unit mass under the force `f(t)`.
//!
//! **Invariant:** every expected number follows from the steps that `integrators.rs` compares with 50 digits, a closed
//! form, or the formula that the specification gives; none comes from a run of this program.

use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::{MAX_STEPS, MAX_WORK, Particle, ParticleError, evaluations};

use crate::integrators::{Acceleration, states};

const SWING: &str = "exp(-t)*cos(5*t)";

fn expression(text: &str) -> Expression {
    Expression::parse(text).unwrap()
}

fn new(
    text: &str,
    (x0, v0): (f64, f64),
    dt: f64,
    steps: u64,
    method: Method,
) -> Result<Particle, ParticleError> {
    Particle::new(expression(text), x0, v0, dt, steps, method)
}

/// A finished computation.
fn run(text: &str, start: (f64, f64), dt: f64, steps: u64, method: Method) -> Particle {
    let mut particle = new(text, start, dt, steps, method).unwrap();
    particle.advance(usize::MAX);
    assert_eq!(particle.remaining(), 0);
    particle
}

fn bits(samples: &[f64]) -> Vec<u64> {
    samples.iter().map(|sample| sample.to_bits()).collect()
}

/// Forces are taken at multiples of the timestep, and sums are compensated.
#[test]
fn every_sample_has_the_bits_of_the_methods_steps() {
    let forces: [(&str, Acceleration); 3] = [
        (SWING, |t, _, _| (-t).exp() * (5.0 * t).cos()),
        ("t*t + 3*t - 1", |t, _, _| t * t + 3.0 * t - 1.0),
        ("-9.81", |_, _, _| -9.81),
    ];
    for (text, force) in forces {
        for method in Method::ALL {
            let particle = run(text, (1.0, -0.5), 0.1, 1000, method);
            let times = (0..=1000).map(|k| f64::from(k) * 0.1);
            assert!(particle.times().eq(times), "no running sums");
            let (x, v): (Vec<f64>, Vec<f64>) = states(method, force, (1.0, -0.5), 0.1, 1000)
                .into_iter()
                .unzip();
            assert_eq!(bits(particle.positions()), bits(&x), "{text} {method}");
            assert_eq!(bits(particle.velocities()), bits(&v), "{text} {method}");
        }
    }
}

#[test]
fn an_impossible_computation_is_refused_by_name_and_value() {
    let (rest, most) = ((0.0, 0.0), MAX_STEPS);
    for (start, dt, steps, message) in [
        (rest, 0.0, 10, "dt must be greater than 0, got 0"),
        (rest, -0.0, 10, "dt must be greater than 0, got 0"),
        (rest, -5e-324, 10, "dt must be greater than 0, got -5e-324"),
        (rest, f64::NAN, 10, "dt must be finite, got NaN"),
        ((f64::NAN, 0.0), 0.1, 10, "x0 must be finite, got NaN"),
        (
            (0.0, f64::NEG_INFINITY),
            0.1,
            10,
            "xdot0 must be finite, got -inf",
        ),
        (rest, 0.1, 0, "steps must be at least 1, got 0"),
        (
            rest,
            0.1,
            most + 1,
            "steps must be at most 1000000, got 1000001",
        ),
    ] {
        let refusal = new("t", start, dt, steps, Method::Rk4).unwrap_err();
        assert_eq!(refusal.to_string(), message);
    }
    assert!(new("t", rest, 0.1, most, Method::Rk4).is_ok());
}

#[test]
fn two_billion_nodes_times_evaluations_are_the_most() {
    assert_eq!(MAX_WORK, 2_000_000_000);
    // 500 nodes, four evaluations, a million steps: exactly the limit.
    let force = "-".repeat(499) + "t";
    let new = |force: &str| new(force, (0.0, 0.0), 0.1, 1_000_000, Method::Rk4);
    assert!(new(&force).is_ok());
    let error = new(&format!("-{force}")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "function has 501 nodes and would be evaluated 4000000 times, the product must be at most 2000000000, \
         got 2004000000"
    );
    for method in Method::ALL {
        assert_eq!(evaluations(u64::MAX, method), u64::MAX, "no overflow");
    }
}

#[test]
fn slices_give_the_same_bits_as_one_computation() {
    for method in Method::ALL {
        let mut whole = run(SWING, (1.0, -0.5), 0.01, 100, method);
        assert_eq!(whole.advance(usize::MAX), 0, "it has ended");
        assert_eq!(whole.evaluations(), evaluations(100, method));
        for slice in [1, 3, 7, 99] {
            let mut sliced = new(SWING, (1.0, -0.5), 0.01, 100, method).unwrap();
            let mut made = 0;
            while sliced.remaining() > 0 {
                let count = sliced.advance(slice);
                assert_eq!(count, slice.min(100 - made));
                made += count;
                assert_eq!(sliced.done(), made);
            }
            assert_eq!(made, 100);
            assert_eq!(bits(sliced.positions()), bits(whole.positions()));
            assert_eq!(bits(sliced.velocities()), bits(whole.velocities()));
        }
    }
}

#[test]
fn a_slice_has_the_steps_that_fit_its_work_and_at_least_one() {
    // Nine nodes, four evaluations: 36 a step.
    let particle = new("t^2 + 3*t - 1", (0.0, 0.0), 0.1, 10, Method::Rk4).unwrap();
    for (work, steps) in [(0, 1), (35, 1), (71, 1), (72, 2), (3600, 100)] {
        assert_eq!(particle.steps_within(work), steps);
    }
}

/// The rounding error of an infinite sum is not a number, and must not be carried.
#[test]
fn a_motion_that_is_infinite_or_no_number_stays_so() {
    for method in Method::ALL {
        for (force, is_right) in [
            ("1e999", f64::is_infinite as fn(f64) -> bool),
            ("1/t", f64::is_infinite),
            ("sqrt(0-1)", f64::is_nan),
        ] {
            let particle = run(force, (0.0, 0.0), 0.25, 8, method);
            let mut positions = particle.positions().iter().skip(2);
            assert!(positions.all(|x| is_right(*x)), "{force} {method}");
        }
    }
}
