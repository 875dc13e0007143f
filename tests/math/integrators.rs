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
    let (mut x_carry, mut v_carry) = (0.0, 0.0);
    for k in 0..steps {
        let t = f64::from(k) * dt;
        let ([dx], [dv]) = increment(method, |t, [x], [v]| [a(t, *x, *v)], t, &[x], &[v], dt);
        (x, x_carry) = two_sum(x, dx + x_carry);
        (v, v_carry) = two_sum(v, dv + v_carry);
        states.push((x, v));
    }
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

/// The time is right at every stage, for a step that starts anywhere and any number of joints.
#[test]
fn every_method_evaluates_at_the_times_of_its_stages_and_no_more() {
    let (t, h) = (3.0, 0.25);
    for (method, times) in [
        (Method::Euler, &[3.0][..]),
        (Method::Midpoint, &[3.0, 3.125]),
        (Method::Verlet, &[3.0, 3.25]),
        (Method::Rk4, &[3.0, 3.125, 3.125, 3.25]),
    ] {
        let mut seen = Vec::new();
        let record = |t: f64, _: &[f64; 3], _: &[f64; 3]| {
            seen.push(t);
            [1.0, -2.0, 0.5]
        };
        increment(method, record, t, &[0.1, 0.2, 0.3], &[1.0, 2.0, 3.0], h);
        assert_eq!(seen, times, "{method}");
        assert_eq!(seen.len(), method.evaluations() as usize, "{method}");
    }
}

#[test]
fn methods_go_by_their_names_and_by_no_others() {
    for method in Method::ALL {
        assert_eq!(method.name().parse(), Ok(method));
        assert_eq!(method.to_string(), method.name());
    }
    let expected = "must be one of euler, midpoint, verlet, rk4";
    for name in ["", "RK4", "rk 4", "euler ", "leapfrog"] {
        assert_eq!(name.parse::<Method>().unwrap_err().to_string(), expected);
    }
}

#[test]
fn two_sum_leaves_nothing_out() {
    for (a, b, sum, left_out) in [
        (1.0, 1e-17, 1.0, 1e-17),
        (1e-17, 1.0, 1.0, 1e-17),
        (9007199254740992.0, 1.0, 9007199254740992.0, 1.0),
        (9007199254740992.0, 3.0, 9007199254740996.0, -1.0),
        (0.1, 0.2, 0.30000000000000004, -2.7755575615628914e-17),
        (0.0, -0.0, 0.0, 0.0),
    ] {
        assert_eq!(two_sum(a, b), (sum, left_out), "{a} + {b}");
    }
}
