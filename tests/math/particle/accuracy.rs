//! Positions and velocities as they must be.
//!
//! **Invariant:** a tolerance counts roundings; none allows for truncation.

use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;
use serde_json::Value;

use super::{last, run};

fn oracle() -> Value {
    serde_json::from_str(include_str!("../../data/integrators.json")).unwrap()
}

/// The oracle's cases whose acceleration depends on time only.
fn oracle_cases() -> Vec<Value> {
    let mut oracle = oracle();
    let mut cases: Vec<Value> = std::mem::take(oracle["cases"].as_array_mut().unwrap());
    cases.retain(|case| case["depends_on"] == "t");
    assert_eq!(cases.len(), 7 * 4 * 11, "7 forces, 4 methods, 11 grids");
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

#[test]
fn every_method_agrees_with_fifty_digits_after_all_steps() {
    for case in oracle_cases() {
        let particle = oracle_run(&case);
        let (x, v) = (number(&case, "x"), number(&case, "v"));
        // Rounding the sum costs half an ulp, 1 unit; rounding the stages of a step costs a random walk far below
        // that, since increments are small beside the state. The oracle would grant a few units *per step*; the sum is
        // compensated, so 3 must do for up to 1000 steps.
        let tolerance = 3.0 * unit(x, v);
        let dx = (last(particle.positions()) - x).abs();
        let dv = (last(particle.velocities()) - v).abs();
        assert!(dx <= tolerance && dv <= tolerance, "{dx:e}, {dv:e}: {case}");
    }
}

#[test]
fn every_method_agrees_with_fifty_digits_after_the_first_step() {
    for case in oracle_cases() {
        let particle = oracle_run(&case);
        let (x, v) = (number(&case, "x1"), number(&case, "v1"));
        // About 2 ulp of the largest term, says the oracle: 4 units.
        let terms = unit(
            x.abs().max(number(&case, "x0").abs()),
            v.abs().max(number(&case, "v0").abs()),
        );
        let dx = (particle.positions()[1] - x).abs();
        let dv = (particle.velocities()[1] - v).abs();
        assert!(
            dx <= 4.0 * terms && dv <= 4.0 * terms,
            "{dx:e}, {dv:e}: {case}"
        );
    }
}

/// Start of the oracle's convergence studies.
const STUDY_START: (f64, f64) = (1.0, -0.5);

/// Errors in position and velocity for `ẍ = sin t`, whose solution is `x0 + (v0 + 1) t - sin t`.
fn errors_on_sine(end: f64, steps: u32, method: Method) -> (f64, f64) {
    let (x0, v0) = STUDY_START;
    let particle = run(
        "sin(t)",
        STUDY_START,
        end / f64::from(steps),
        u64::from(steps),
        method,
    );
    (
        last(particle.positions()) - (x0 + (v0 + 1.0) * end - end.sin()),
        last(particle.velocities()) - (v0 + 1.0 - end.cos()),
    )
}

#[test]
fn truncation_errors_are_those_of_the_oracle() {
    let studies = oracle();
    let of_sine = studies["orders"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|s| s["problem"] == "sin");
    for study in of_sine {
        assert_eq!((number(study, "x0"), number(study, "v0")), STUDY_START);
        assert_eq!(number(study, "T"), 2.0);
        let method: Method = study["method"].as_str().unwrap().parse().unwrap();
        for (index, steps) in [8, 16, 32, 64, 128, 256].into_iter().enumerate() {
            let (dx, dv) = errors_on_sine(2.0, steps, method);
            for (found, given) in [(dx, &study["err_x"][index]), (dv, &study["err_v"][index])] {
                let given = given.as_f64().unwrap();
                // Six digits are given; 4e-16 are two roundings of values up to 2.
                let tolerance = 1e-5 * given.abs() + 4e-16;
                assert!(
                    (found - given).abs() <= tolerance,
                    "{method}: {found:e}, {given:e}"
                );
            }
        }
    }
}

#[test]
fn halving_the_timestep_divides_the_error_by_two_to_the_order() {
    for method in Method::ALL {
        let (coarse, _) = errors_on_sine(2.0, 64, method);
        let (fine, _) = errors_on_sine(2.0, 128, method);
        let observed = (coarse / fine).log2();
        // The next term of the error series is dt = 1/32 times smaller, and halves too.
        assert!(
            (observed - f64::from(method.order())).abs() < 0.05,
            "{method}: {observed}"
        );
    }
}

// The specification's example, f(t) = t from rest. With dt = 1/8 every operation of Euler, midpoint and Verlet is exact.

#[test]
fn euler_on_f_of_t_equal_t_lags_by_a_whole_step() {
    let particle = run("t", (0.0, 0.0), 0.125, 8, Method::Euler);
    // v_n = dt² Σ k = dt² n(n-1)/2 and x_n = dt Σ v_k = dt³ n(n-1)(n-2)/6, with n = 8.
    assert_eq!(last(particle.velocities()), 28.0 / 64.0);
    assert_eq!(last(particle.positions()), 56.0 / 512.0);
}

#[test]
fn midpoint_and_verlet_on_f_of_t_equal_t_are_exact_in_velocity() {
    for method in [Method::Midpoint, Method::Verlet] {
        let particle = run("t", (0.0, 0.0), 0.125, 8, method);
        // v_n = t²/2. Both move x by dt v_k + dt²/2 f(t_k), so x_n = dt³ (n³ - n)/6, with n = 8.
        assert_eq!(last(particle.velocities()), 0.5, "{method}");
        assert_eq!(last(particle.positions()), 84.0 / 512.0, "{method}");
    }
}

#[test]
fn rk4_on_f_of_t_equal_t_gives_the_closed_form() {
    let particle = run("t", (0.0, 0.0), 0.125, 8, Method::Rk4);
    for (t, x) in particle.times().zip(particle.positions()) {
        // A step divides by 6, which rounds: a few units in the last place of the result.
        assert!(
            (x - t.powi(3) / 6.0).abs() <= 2.0 * f64::EPSILON * x,
            "{t}: {x}"
        );
    }
}

#[test]
fn a_better_method_is_better_at_the_same_timestep() {
    let error = |method| errors_on_sine(2.0, 20, method).0.abs();
    assert!(error(Method::Euler) > 10.0 * error(Method::Midpoint));
    assert!(error(Method::Euler) > 10.0 * error(Method::Verlet));
    assert!(error(Method::Midpoint) > 100.0 * error(Method::Rk4));
    assert!(error(Method::Verlet) > 100.0 * error(Method::Rk4));
}

#[test]
fn a_million_steps_lose_no_more_digits_than_one() {
    let particle = run("t", (1.0, -0.5), 1e-6, 1_000_000, Method::Rk4);
    // x = 1 - 1/2 + 1/6 and v = -1/2 + 1/2. Two roundings of the end and of its expected value; an uncompensated sum is
    // off by 1.3e-13 in x.
    assert!((last(particle.positions()) - (0.5 + 1.0 / 6.0)).abs() <= 2.0 * f64::EPSILON);
    assert!(last(particle.velocities()).abs() <= 2.0 * f64::EPSILON);
}
