//! "Project checkpoint: Numerical Integration Step Service" and "The function field".

use serde_json::{Value, json};

use crate::bench::{Bench, same};
use crate::method::METHODS;
use crate::values::{list, near, set};
use crate::{Check, Got};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("checkpoint-1", |bench| {
        for method in METHODS {
            for steps in [1, 7] {
                bench.integrate("sin(t)", [0.0, 0.0, 0.01], steps, method)?;
            }
        }
        Ok("2 and 8 entries".to_owned())
    }),
    ("checkpoint-2", |bench| {
        let [times, positions, velocities] = bench.integrate("t", [1.5, -0.75, 0.1], 2, "euler")?;
        let first: Vec<f64> = [times, positions, velocities].iter().filter_map(|values| values.first().copied()).collect();
        near("the starting point", &first, &[0.0, 1.5, -0.75], 1e-12)?;
        Ok(list(&first))
    }),
    ("checkpoint-3", |bench| {
        let request = json!({"function": "t", "x0": 0.5, "dt": 0.1, "steps": 3, "integrator": "rk4"});
        let values = bench.accepted("/arm_sim/integration_step", &request)?;
        let first = crate::values::number(&values, "velocities/0")?;
        near("velocities", &[first], &[0.0], 1e-12)?;
        Ok(first.to_string())
    }),
    ("checkpoint-4", |bench| {
        let [times, ..] = bench.integrate("0", [0.0, 0.0, 0.05], 40, "rk4")?;
        let expected: Vec<f64> = (0..=40).map(|k| 0.05 * f64::from(k)).collect();
        near("times", &times, &expected, 1e-9)?;
        Ok("0 to 2 s by 0.05 s".to_owned())
    }),
    ("checkpoint-5", |bench| {
        let (x0, v0, a, dt) = (1.0, 2.0, -3.0, 0.125);
        for method in METHODS {
            let [_, positions, velocities] = bench.integrate("-3", [x0, v0, dt], 16, method)?;
            let times: Vec<f64> = (0..=16).map(|k| dt * f64::from(k)).collect();
            let x: Vec<f64> = times.iter().map(|t| x0 + v0 * t + 0.5 * a * t * t).collect();
            let v: Vec<f64> = times.iter().map(|t| v0 + a * t).collect();
            if method != "euler" {
                near(&format!("positions by {method}"), &positions, &x, 1e-9)?;
            }
            near(&format!("velocities by {method}"), &velocities, &v, 1e-9)?;
        }
        Ok("the closed form".to_owned())
    }),
    ("checkpoint-6", |bench| {
        let before = bench.integrate("cos(2*t)", [0.1, 0.2, 0.1], 10, "midpoint")?;
        bench.set_gravity(1.0)?;
        bench.accepted("/arm_sim/set_integrator", &json!({"method": "euler", "timestep": 0.004}))?;
        bench.swing()?;
        let after = bench.integrate("cos(2*t)", [0.1, 0.2, 0.1], 10, "midpoint")?;
        near("positions", &after[1], &before[1], 1e-15)?;
        near("velocities", &after[2], &before[2], 1e-15)?;
        Ok("the same answer".to_owned())
    }),
    ("checkpoint-7", |bench| {
        bench.swing()?;
        bench.pause(true)?;
        let before = bench.fresh()?;
        let settings = bench.accepted("/arm_sim/set_integrator", &json!({}))?;
        bench.integrate("1000", [5.0, 6.0, 0.1], 10, "verlet")?;
        let after = bench.fresh()?;
        near("position", &after.position, &before.position, 1e-12)?;
        near("velocity", &after.velocity, &before.velocity, 1e-12)?;
        same(&settings, &bench.accepted("/arm_sim/set_integrator", &json!({}))?, &["method", "timestep"])?;
        Ok("nothing changed".to_owned())
    }),
    ("checkpoint-8", |bench| rejects(bench, &[("integrator", json!("rk5")), ("integrator", json!(""))])),
    ("checkpoint-9", |bench| rejects(bench, &[("dt", json!(0.0)), ("dt", json!(-0.1))])),
    ("checkpoint-10", |bench| rejects(bench, &[("steps", json!(0))])),
    ("checkpoint-11", |bench| rejects_functions(bench, &["2 +", "* t", "sin", "sin()", "t t"])),
    ("checkpoint-12", |bench| {
        for _ in 0..5 {
            rejects(bench, &[("function", json!("((t")), ("integrator", json!("leapfrog")), ("dt", json!(-1)), ("steps", json!(0))])?;
        }
        bench.integrate("t", [0.0, 0.0, 0.1], 3, "rk4")?;
        Ok("an accepted call".to_owned())
    }),
    ("function-1", |bench| {
        evaluates(
            bench,
            &[
                ("10-4-3", |_| 3.0),
                ("7/2", |_| 3.5),
                ("16/4/2", |_| 2.0),
                ("2+3*4", |_| 14.0),
                ("2*3+4", |_| 10.0),
                ("7-6/2", |_| 4.0),
                ("12/2*3", |_| 18.0),
                ("t - 2*t + 5", |t| 5.0 - t),
                ("t*t/4", |t| t * t / 4.0),
            ],
        )
    }),
    ("function-2", |bench| {
        evaluates(bench, &[("2^3^2", |_| 512.0), ("2*3^2", |_| 18.0), ("12/2^2", |_| 3.0), ("t^3", |t| t.powi(3)), ("2^t", f64::exp2)])
    }),
    ("function-3", |bench| {
        evaluates(
            bench,
            &[
                ("-3^2", |_| 9.0),
                ("2^-1", |_| 0.5),
                ("3--2", |_| 5.0),
                ("2*-t", |t| -2.0 * t),
                ("-t^2", |t| t * t),
                ("-(t+1)", |t| -t - 1.0),
            ],
        )
    }),
    ("function-4", |bench| {
        evaluates(
            bench,
            &[("(1+2)*3", |_| 9.0), ("10-(4-3)", |_| 9.0), ("2^(1+2)", |_| 8.0), ("(2^3)^2", |_| 64.0), ("((t))*(t+1)", |t| t * (t + 1.0))],
        )
    }),
    ("function-5", |bench| evaluates(bench, &[("0.25", |_| 0.25), ("12.5", |_| 12.5), ("3", |_| 3.0)])),
    ("function-6", |bench| {
        evaluates(
            bench,
            &[
                ("sin(t)", f64::sin),
                ("cos(t)", f64::cos),
                ("tan(t)", f64::tan),
                ("exp(t)", f64::exp),
                ("sqrt(t)", f64::sqrt),
                ("ln(t + 1)", f64::ln_1p),
                ("abs(t - 1)", |t| (t - 1.0).abs()),
                ("2*sin(cos(t))", |t| 2.0 * t.cos().sin()),
            ],
        )
    }),
    ("function-7", |bench| {
        evaluates(bench, &[("t", |t| t), ("sin(t)", f64::sin), ("t^2 + 3*t - 1", |t| t * t + 3.0 * t - 1.0), ("-t + 1", |t| 1.0 - t)])
    }),
    ("function-8", |bench| rejects_functions(bench, &["", "  "])),
    ("function-9", |bench| rejects_functions(bench, &["(t", "t)", "sin(t", "((t)", ")("])),
    ("function-10", |bench| rejects_functions(bench, &["x", "foo(t)", "tt", "sinus(t)"])),
    ("function-11", |bench| rejects_functions(bench, &["t + 1 )", "t + 1 garbage", "sin(t) 5"])),
    ("function-12", |bench| rejects_functions(bench, &["1 2", "t t", "(t)(t)"])),
    ("function-13", |bench| rejects_functions(bench, &["t $ 2", "t @ 1", "#", "t ? 1"])),
    ("function-14", |bench| {
        let answer = bench.peer.call("/arm_sim/integration_step", &with("function", &json!("sqrt(-1)")))?;
        bench.integrate("t", [0.0, 0.0, 0.1], 3, "rk4")?;
        Ok(format!("result {}, then an accepted call", answer.result))
    }),
];

fn request() -> Value {
    json!({"function": "t", "x0": 0.5, "xdot0": -0.25, "dt": 0.1, "steps": 3, "integrator": "rk4"})
}

/// The request with one member changed.
fn with(name: &str, value: &Value) -> Value {
    let mut request = request();
    set(&mut request, name, value.clone());
    request
}

/// Passes if the request is rejected with each of these members.
fn rejects(bench: &mut Bench, members: &[(&str, Value)]) -> Got {
    let requests: Vec<Value> = members.iter().map(|(name, value)| with(name, value)).collect();
    bench.rejects("/arm_sim/integration_step", &requests)
}

fn rejects_functions(bench: &mut Bench, functions: &[&str]) -> Got {
    let members: Vec<(&str, Value)> = functions.iter().map(|function| ("function", json!(function))).collect();
    rejects(bench, &members)
}

/// A function as it is sent, and its value at a time.
type Expression = (&'static str, fn(f64) -> f64);

/// Passes if each function has its value at t = 0, 0.5, 1 and 1.5. By forward Euler the velocity grows by `f(t) dt`.
fn evaluates(bench: &mut Bench, table: &[Expression]) -> Got {
    for (function, value) in table {
        let [_, _, velocities] = bench.integrate(function, [0.0, 0.0, 0.5], 4, "euler")?;
        let got: Vec<f64> = velocities
            .windows(2)
            .map(|pair| pair.iter().rev().copied().reduce(|next, last| (next - last) / 0.5).unwrap_or(f64::NAN))
            .collect();
        let expected: Vec<f64> = [0.0, 0.5, 1.0, 1.5].into_iter().map(value).collect();
        near(&format!("{function} at t = 0, 0.5, 1, 1.5: value"), &got, &expected, 1e-9)?;
    }
    Ok(format!("{} expressions as expected", table.len()))
}
