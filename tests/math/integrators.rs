//! The one-step methods: their evaluations and their accuracy, against 50-digit values.

use pendularm::math::integrator::{Method, increment, two_sum};
use serde_json::Value;

use crate::stored::{entries, method, number};

/// `ẍ = a(t, x, v)`.
pub(crate) type Acceleration = fn(f64, f64, f64) -> f64;

/// Unit roundoff: half a unit in the last place of 1.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

const STORED: &str = include_str!("../data/integrators.json");

fn acceleration(case: &Value) -> Acceleration {
    match case["problem"].as_str().unwrap() {
        "t" => |t, _, _| t,
        "sin" => |t, _, _| t.sin(),
        "damped_cos" => |t, _, _| (-t).exp() * (5.0 * t).cos(),
        "constant" => |_, _, _| -9.81,
        "osc_damped_driven" => |t, x, v| -4.0 * x - 0.5 * v + t.sin(),
        "oscillator" => |_, x, _| -x,
        "drag_linear" => |_, _, v| -3.0 * v,
        "pendulum" => |_, x, _| -x.sin(),
        "quadratic_drag_fall" => |_, _, v| -1.0 - v * v.abs(),
        other => panic!("no such problem: {other}"),
    }
}

/// The states from the start at t = 0 on, step `k` at time `k dt`, with compensated sums as the live arm has.
pub(crate) fn states(
    method: Method,
    a: Acceleration,
    (mut x, mut v): (f64, f64),
    dt: f64,
    steps: u32,
) -> Vec<(f64, f64)> {
    let mut states = vec![(x, v)];
    let (mut x_carry, mut v_carry, mut evaluations) = (0.0, 0.0, 0);
    for k in 0..steps {
        let t = f64::from(k) * dt;
        let acceleration = |t, [x]: &[f64; 1], [v]: &[f64; 1]| {
            evaluations += 1;
            [a(t, *x, *v)]
        };
        let ([dx], [dv]) = increment(method, acceleration, t, &[x], &[v], dt);
        (x, x_carry) = two_sum(x, dx + x_carry);
        (v, v_carry) = two_sum(v, dv + v_carry);
        states.push((x, v));
    }
    assert_eq!(evaluations, steps * method.evaluations(), "{method}");
    states
}

/// Compensated sums leave the rounding of the increments, which is relative to their size, and that of the final sum:
/// a few half units however many steps there are.
#[test]
fn any_number_of_steps_agrees_with_50_digits() {
    for case in entries(STORED, "cases") {
        let [x0, v0, dt] = ["x0", "v0", "dt"].map(|name| number(&case[name]));
        let steps = case["steps"].as_u64().unwrap() as u32;
        let states = states(method(&case), acceleration(&case), (x0, v0), dt, steps);
        let (x, v) = states[states.len() - 1];
        let want = [number(&case["x"]), number(&case["v"])];
        let scale = want[0].abs().max(want[1].abs()).max(1.0);
        for (got, want) in [x, v].into_iter().zip(want) {
            let off = (got - want).abs();
            assert!(off <= 4.0 * ROUND_OFF * scale, "got {got}: {case}");
        }
    }
}

/// On an oscillator half the timestep divides the error by 2 to the power of the order.
#[test]
fn a_method_has_the_order_that_it_states() {
    for (method, name) in [
        (Method::Euler, "euler"),
        (Method::Midpoint, "midpoint"),
        (Method::Verlet, "verlet"),
        (Method::Rk4, "rk4"),
    ] {
        let error = |steps: u32| {
            let dt = 1.0 / f64::from(steps);
            let states = states(method, |_, x, _| -x, (1.0, 0.0), dt, steps);
            let (x, v) = states[steps as usize];
            (x - 1.0_f64.cos()).abs().max((v + 1.0_f64.sin()).abs())
        };
        let order = (error(100) / error(200)).log2();
        let off = (order - f64::from(method.order())).abs();
        assert!(off < 0.05, "{method}: order {order}");
        assert_eq!(method.to_string(), name);
    }
}
