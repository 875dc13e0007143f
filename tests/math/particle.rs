//! The computation behind `/arm_sim/integration_step`: a unit mass under the force `f(t)`.
//!
//! **Invariant:** every expected number comes from the 50-digit oracle, a closed form, or the formula that the
//! specification gives; none from a run of this program. A tolerance counts roundings; none allows for truncation.

use pendularm::math::expression::Expression;
use pendularm::math::integrator::{Method, increment};
use pendularm::math::particle::{MAX_STEPS, MAX_WORK, Particle, evaluations};
use serde_json::Value;

fn expression(text: &str) -> Expression {
    Expression::parse(text).unwrap()
}

/// A finished computation.
fn run(text: &str, start: (f64, f64), dt: f64, steps: u64, method: Method) -> Particle {
    let mut particle =
        Particle::new(expression(text), start.0, start.1, dt, steps, method).unwrap();
    particle.advance(usize::MAX);
    assert_eq!(particle.remaining(), 0);
    particle
}

/// The oracle's cases whose acceleration depends on time only.
fn oracle_cases() -> Vec<Value> {
    let text = include_str!("../data/integrators.json");
    let mut oracle: Value = serde_json::from_str(text).unwrap();
    let mut cases: Vec<Value> = std::mem::take(oracle["cases"].as_array_mut().unwrap());
    cases.retain(|case| case["depends_on"] == "t");
    assert_eq!(cases.len(), 7 * 4 * 5, "7 forces, 4 methods, 5 grids");
    cases
}

fn number(case: &Value, field: &str) -> f64 {
    case[field].as_f64().unwrap()
}

fn oracle_run(case: &Value) -> Particle {
    // One force is given as `-9.81 (the float64)`.
    let force = case["acceleration"]
        .as_str()
        .unwrap()
        .replace(" (the float64)", "");
    run(
        &force,
        (number(case, "x0"), number(case, "v0")),
        number(case, "dt"),
        case["steps"].as_u64().unwrap(),
        case["method"].as_str().unwrap().parse().unwrap(),
    )
}

/// The unit of the oracle's bound: `2^-53 max(|x|, |v|, 1)`.
fn unit(x: f64, v: f64) -> f64 {
    f64::EPSILON / 2.0 * x.abs().max(v.abs()).max(1.0)
}

/// About 2 ulp of the largest term after one step, says the oracle: 4 units. Rounding the sum of all steps costs half an ulp, 1
/// unit; rounding the stages of a step costs a random walk far below that. The sum is compensated, so 3 units must do for 1000 steps.
#[test]
fn every_method_agrees_with_fifty_digits_after_one_step_and_after_all() {
    for case in oracle_cases() {
        let particle = oracle_run(&case);
        let end = particle.positions().len() - 1;
        for (index, x, v, units) in [(1, "x1", "v1", 4.0), (end, "x", "v", 3.0)] {
            let (x, v) = (number(&case, x), number(&case, v));
            let (x0, v0) = (number(&case, "x0"), number(&case, "v0"));
            let from = if index == 1 { (x0, v0) } else { (0.0, 0.0) };
            let tolerance = units * unit(x.abs().max(from.0.abs()), v.abs().max(from.1.abs()));
            let dx = (particle.positions()[index] - x).abs();
            let dv = (particle.velocities()[index] - v).abs();
            assert!(
                dx <= tolerance && dv <= tolerance,
                "{index}: {dx:e}, {dv:e}: {case}"
            );
        }
    }
}

/// The first of `Particle::new`'s complaints.
fn refusal(text: &str, start: (f64, f64), dt: f64, steps: u64) -> String {
    let particle = Particle::new(expression(text), start.0, start.1, dt, steps, Method::Rk4);
    particle.unwrap_err().to_string()
}

#[test]
fn an_impossible_computation_is_refused_by_name_and_value() {
    for (start, dt, steps, message) in [
        ((0.0, 0.0), 0.0, 10, "dt must be greater than 0, got 0"),
        ((0.0, 0.0), -0.0, 10, "dt must be greater than 0, got 0"),
        (
            (0.0, 0.0),
            -5e-324,
            10,
            "dt must be greater than 0, got -5e-324",
        ),
        ((0.0, 0.0), f64::NAN, 10, "dt must be finite, got NaN"),
        ((f64::NAN, 0.0), 0.1, 10, "x0 must be finite, got NaN"),
        (
            (0.0, f64::NEG_INFINITY),
            0.1,
            10,
            "xdot0 must be finite, got -inf",
        ),
        ((0.0, 0.0), 0.1, 0, "steps must be at least 1, got 0"),
        (
            (0.0, 0.0),
            0.1,
            MAX_STEPS + 1,
            "steps must be at most 1000000, got 1000001",
        ),
    ] {
        assert_eq!(refusal("t", start, dt, steps), message);
    }
    assert!(Particle::new(expression("t"), 0.0, 0.0, 0.1, MAX_STEPS, Method::Rk4).is_ok());
}

#[test]
fn two_billion_nodes_times_evaluations_are_the_most() {
    assert_eq!(MAX_WORK, 2_000_000_000);
    // 500 nodes, four evaluations, a million steps: exactly the limit.
    let force = "-".repeat(499) + "t";
    let new = |force: &str| Particle::new(expression(force), 0.0, 0.0, 0.1, 1_000_000, Method::Rk4);
    assert!(new(&force).is_ok());
    let error = new(&format!("-{force}")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "function has 501 nodes and would be evaluated 4000000 times, the product must be at most 2000000000, \
         got 2004000000"
    );
}

#[test]
fn counting_evaluations_does_not_overflow() {
    for method in Method::ALL {
        assert_eq!(evaluations(u64::MAX, method), u64::MAX);
    }
}

fn bits(samples: &[f64]) -> Vec<u64> {
    samples.iter().map(|sample| sample.to_bits()).collect()
}

#[test]
fn times_are_multiples_of_the_timestep_and_not_running_sums() {
    let times: Vec<f64> = run("t", (0.0, 0.0), 0.1, 10, Method::Euler)
        .times()
        .collect();
    let expected: Vec<f64> = (0..=10).map(|k| f64::from(k) * 0.1).collect();
    assert_eq!(times, expected);
    // Ten times 0.1 is 1; adding 0.1 ten times gives 0.9999999999999999.
    assert_eq!(times[10], 1.0);
}

#[test]
fn forces_are_taken_at_multiples_of_the_timestep() {
    // Euler's last step starts at 100 · 0.1 = 10, where the summed time is 9.99999999999998; there ln(10 - t) is finite.
    let particle = run("ln(10-t)", (0.0, 0.0), 0.1, 101, Method::Euler);
    let [.., before, end] = particle.velocities() else {
        panic!("102 entries");
    };
    assert!(before.is_finite());
    assert_eq!(*end, f64::NEG_INFINITY);
}

#[test]
fn slices_give_the_same_bits_as_one_computation() {
    for method in Method::ALL {
        let whole = run("exp(-t)*cos(5*t)", (1.0, -0.5), 0.01, 100, method);
        for slice in [1, 3, 7, 99] {
            let force = expression("exp(-t)*cos(5*t)");
            let mut sliced = Particle::new(force, 1.0, -0.5, 0.01, 100, method).unwrap();
            let mut made = 0;
            while sliced.remaining() > 0 {
                let before = sliced.done();
                let count = sliced.advance(slice);
                assert_eq!(count, slice.min(100 - before));
                assert_eq!(sliced.done(), before + count);
                made += count;
            }
            assert_eq!(made, 100);
            assert_eq!(bits(sliced.positions()), bits(whole.positions()));
            assert_eq!(bits(sliced.velocities()), bits(whole.velocities()));
        }
    }
}

#[test]
fn a_finished_computation_makes_no_further_step() {
    let mut particle = run("t", (0.0, 0.0), 0.1, 5, Method::Rk4);
    assert_eq!(particle.advance(usize::MAX), 0);
    assert_eq!((particle.done(), particle.evaluations()), (5, 20));
}

#[test]
fn a_slice_has_the_steps_that_fit_its_work_and_at_least_one() {
    // Nine nodes, four evaluations: 36 a step.
    let force = expression("t^2 + 3*t - 1");
    let particle = Particle::new(force, 0.0, 0.0, 0.1, 10, Method::Rk4).unwrap();
    for (work, steps) in [(0, 1), (35, 1), (71, 1), (72, 2), (3600, 100)] {
        assert_eq!(particle.steps_within(work), steps);
    }
}

// Values that are no numbers.

/// The same steps, summed without compensation.
fn summed_plainly(force: &str, dt: f64, steps: u32, method: Method) -> Vec<(f64, f64)> {
    let force = expression(force);
    let (mut x, mut v) = (0.0, 0.0);
    let step = |k: u32| {
        let acceleration = |t, _: &[f64; 1], _: &[f64; 1]| [force.evaluate(t)];
        let t = f64::from(k) * dt;
        let (dx, dv) = increment(method, acceleration, t, &[x], &[v], dt);
        (x, v) = (x + dx[0], v + dv[0]);
        (x, v)
    };
    (0..steps).map(step).collect()
}

#[test]
fn values_that_are_not_finite_flow_on_as_in_ordinary_arithmetic() {
    let class = |x: f64| (x.is_nan(), x.is_infinite(), x.is_infinite() && x > 0.0);
    for force in [
        "sqrt(0-1)",
        "1/t",
        "ln(t)",
        "1/(t-0.5)",
        "sqrt(0.5-t)",
        "1e999",
        "1e307",
        "exp(900*t)",
    ] {
        for method in Method::ALL {
            let particle = run(force, (0.0, 0.0), 0.25, 8, method);
            let samples = particle
                .positions()
                .iter()
                .zip(particle.velocities())
                .skip(1);
            for ((x, v), plain) in samples.zip(summed_plainly(force, 0.25, 8, method)) {
                assert_eq!(
                    (class(*x), class(*v)),
                    (class(plain.0), class(plain.1)),
                    "{force} {method}"
                );
            }
        }
    }
}
