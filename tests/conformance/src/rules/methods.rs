//! "Numerical integrators": the four methods, by `/arm_sim/integration_step`.

use crate::bench::Bench;
use crate::method::{METHODS, particle};
use crate::values::{must, near};
use crate::{Got, Rule, rule};

/// The rules of this part.
pub const RULES: &[Rule] = &[
    rule("method-1", "euler steps with the state and the acceleration at the start", "the states of that formula, to 1e-9", |bench| {
        takes_steps(bench, "euler")
    }),
    rule("method-2", "midpoint takes the full step with the values at the middle", "the states of that formula, to 1e-9", |bench| {
        takes_steps(bench, "midpoint")
    }),
    rule("method-3", "verlet averages the accelerations at both ends", "the states of that formula, to 1e-9", |bench| {
        takes_steps(bench, "verlet")
    }),
    rule("method-4", "rk4 blends four stages 1:2:2:1", "the states of that formula, to 1e-9", |bench| takes_steps(bench, "rk4")),
    rule(
        "method-5",
        "Stages evaluate the force at their own time",
        "for f(t) = t from rest: v = t^2/2 to 1e-9 by midpoint, verlet and rk4",
        stage_times,
    ),
    rule("method-6", "rk4 solves f(t) = t exactly", "x = t^3/6 to 1e-9", cubic),
    rule(
        "method-7",
        "The error falls by the order of the method when dt is halved",
        "by 2 for euler, 4 for midpoint and verlet, 16 for rk4",
        orders,
    ),
    rule("method-8", "euler is the least accurate, rk4 the most", "errors in that order for sin(t)", ranking),
];

fn force(t: f64) -> f64 {
    (3.0 * t).sin() + t * t - 1.0
}

fn takes_steps(bench: &mut Bench, method: &str) -> Got {
    let [_, positions, velocities] = bench.integrate("sin(3*t) + t^2 - 1", [0.3, -0.2, 0.1], 20, method)?;
    let [_, x, v] = particle(method, force, 0.3, -0.2, 0.1, 20);
    near("positions", &positions, &x, 1e-9)?;
    near("velocities", &velocities, &v, 1e-9)?;
    Ok("20 steps of it".to_owned())
}

fn stage_times(bench: &mut Bench) -> Got {
    let expected: Vec<f64> = (0..=10).map(|k| 0.5 * (0.2 * f64::from(k)).powi(2)).collect();
    for method in ["midpoint", "verlet", "rk4"] {
        let [_, _, velocities] = bench.integrate("t", [0.0, 0.0, 0.2], 10, method)?;
        near(&format!("velocities by {method}"), &velocities, &expected, 1e-9)?;
    }
    Ok("t^2/2 by all three".to_owned())
}

fn cubic(bench: &mut Bench) -> Got {
    let [times, positions, _] = bench.integrate("t", [0.0, 0.0, 0.2], 10, "rk4")?;
    let expected: Vec<f64> = times.iter().map(|t| t.powi(3) / 6.0).collect();
    near("positions", &positions, &expected, 1e-9)?;
    Ok("t^3/6".to_owned())
}

/// The error of the position at t = 2 for `f(t) = sin(t)` from rest, where `x = t - sin t`.
fn error(bench: &mut Bench, method: &str, steps: u32) -> Result<f64, String> {
    let [_, positions, _] = bench.integrate("sin(t)", [0.0, 0.0, 2.0 / f64::from(steps)], steps, method)?;
    let last = positions.last().copied().unwrap_or(f64::NAN);
    Ok((last - (2.0 - 2.0_f64.sin())).abs())
}

fn orders(bench: &mut Bench) -> Got {
    let mut got = Vec::new();
    for (method, factor) in [("euler", 2.0), ("midpoint", 4.0), ("verlet", 4.0), ("rk4", 16.0)] {
        let ratio = error(bench, method, 20)? / error(bench, method, 40)?;
        must(ratio > 0.85 * factor && ratio < 1.3 * factor, || format!("{method}: by {ratio:.2} instead of {factor}"))?;
        got.push(format!("{method} {ratio:.2}"));
    }
    Ok(got.join(", "))
}

fn ranking(bench: &mut Bench) -> Got {
    let mut errors = Vec::new();
    for method in METHODS {
        errors.push((method, error(bench, method, 20)?));
    }
    let shown: Vec<String> = errors.iter().map(|(method, error)| format!("{method} {error:.1e}")).collect();
    let of = |name| errors.iter().find(|(method, _)| *method == name).map_or(f64::NAN, |(_, error)| *error);
    let middle = [of("midpoint"), of("verlet")];
    let in_order = middle.iter().all(|error| 2.0 * error < of("euler") && of("rk4") < 0.1 * error);
    must(in_order, || shown.join(", "))?;
    Ok(shown.join(", "))
}
