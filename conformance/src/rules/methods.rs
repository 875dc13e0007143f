//! "Numerical integrators": the four methods, by `/arm_sim/integration_step`.

use crate::bench::Bench;
use crate::method::{METHODS, particle};
use crate::values::{must, near};
use crate::{Check, Got};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("method-1", |bench| takes_steps(bench, "euler")),
    ("method-2", |bench| takes_steps(bench, "midpoint")),
    ("method-3", |bench| takes_steps(bench, "verlet")),
    ("method-4", |bench| takes_steps(bench, "rk4")),
    ("method-5", |bench| {
        let expected: Vec<f64> = (0..=10).map(|k| 0.5 * (0.2 * f64::from(k)).powi(2)).collect();
        for method in ["midpoint", "verlet", "rk4"] {
            let [_, _, velocities] = bench.integrate("t", [0.0, 0.0, 0.2], 10, method)?;
            near(&format!("velocities by {method}"), &velocities, &expected, 1e-9)?;
        }
        Ok("t^2/2 by all three".to_owned())
    }),
    ("method-6", |bench| {
        let [times, positions, _] = bench.integrate("t", [0.0, 0.0, 0.2], 10, "rk4")?;
        let expected: Vec<f64> = times.iter().map(|t| t.powi(3) / 6.0).collect();
        near("positions", &positions, &expected, 1e-9)?;
        Ok("t^3/6".to_owned())
    }),
    ("method-7", |bench| {
        let mut got = Vec::new();
        for (method, factor) in [("euler", 2.0), ("midpoint", 4.0), ("verlet", 4.0), ("rk4", 16.0)] {
            let ratio = error(bench, method, 20)? / error(bench, method, 40)?;
            must(ratio > 0.85 * factor && ratio < 1.3 * factor, || format!("{method}: by {ratio:.2} instead of {factor}"))?;
            got.push(format!("{method} {ratio:.2}"));
        }
        Ok(got.join(", "))
    }),
    ("method-8", |bench| {
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
    }),
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

/// The error of the position at t = 2 for `f(t) = sin(t)` from rest, where `x = t - sin t`.
fn error(bench: &mut Bench, method: &str, steps: u32) -> Result<f64, String> {
    let [_, positions, _] = bench.integrate("sin(t)", [0.0, 0.0, 2.0 / f64::from(steps)], steps, method)?;
    let last = positions.last().copied().unwrap_or(f64::NAN);
    Ok((last - (2.0 - 2.0_f64.sin())).abs())
}
