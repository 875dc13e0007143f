//! The one-step methods: their evaluations and their accuracy, against 50-digit values.

use pendularm::math::integrator::{Method, increment, two_sum};
use serde::Deserialize;

/// `ẍ = a(t, x, v)`.
type Acceleration = fn(f64, f64, f64) -> f64;

/// Unit roundoff: half a unit in the last place of 1.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
    orders: Vec<Order>,
}

/// One problem, method and timestep; `x`, `v` after the last step.
#[derive(Deserialize)]
struct Case {
    problem: String,
    method: String,
    dt: f64,
    steps: u32,
    x0: f64,
    v0: f64,
    x: f64,
    v: f64,
}

/// Errors at time `T` under repeated halving of the timestep.
#[derive(Deserialize)]
struct Order {
    problem: String,
    method: String,
    #[serde(rename = "T")]
    end: f64,
    x0: f64,
    v0: f64,
    dts: Vec<f64>,
    err_x: Vec<f64>,
    err_v: Vec<f64>,
    order_x: Vec<Option<f64>>,
    order_v: Vec<Option<f64>>,
}

fn oracle() -> Oracle {
    serde_json::from_str(include_str!("../data/integrators.json")).unwrap()
}

fn acceleration(problem: &str) -> Acceleration {
    match problem {
        "t" => |t, _, _| t,
        "sin" => |t, _, _| t.sin(),
        "quadratic" => |t, _, _| t * t + 3.0 * t - 1.0,
        "neg_linear" => |t, _, _| -t + 1.0,
        "damped_cos" => |t, _, _| (-t).exp() * (5.0 * t).cos(),
        "rational" => |t, _, _| 1.0 / (1.0 + t * t),
        "constant" => |_, _, _| -9.81,
        "osc_damped_driven" => |t, x, v| -4.0 * x - 0.5 * v + t.sin(),
        "oscillator" => |_, x, _| -x,
        "drag_linear" => |_, _, v| -3.0 * v,
        "pendulum" => |_, x, _| -x.sin(),
        "quadratic_drag_fall" => |_, _, v| -1.0 - v * v.abs(),
        other => panic!("no such problem: {other}"),
    }
}

/// `steps` steps from `(x0, v0)` at t = 0, step `k` at time `k dt`, with compensated sums as the live arm has.
fn run(method: Method, a: Acceleration, x0: f64, v0: f64, dt: f64, steps: u32) -> (f64, f64) {
    let (mut x, mut v) = (x0, v0);
    let (mut x_carry, mut v_carry) = (0.0, 0.0);
    for k in 0..steps {
        let t = f64::from(k) * dt;
        let ([dx], [dv]) = increment(method, |t, [x], [v]| [a(t, *x, *v)], t, &[x], &[v], dt);
        (x, x_carry) = two_sum(x, dx + x_carry);
        (v, v_carry) = two_sum(v, dv + v_carry);
    }
    (x, v)
}

/// Compensated sums leave the rounding of the increments, which is relative to their size, and that of the final sum:
/// a few half units however many steps there are.
#[test]
fn any_number_of_steps_agrees_with_50_digits() {
    for case in oracle().cases {
        let method: Method = case.method.parse().unwrap();
        let a = acceleration(&case.problem);
        let (x, v) = run(method, a, case.x0, case.v0, case.dt, case.steps);
        let scale = case.x.abs().max(case.v.abs()).max(1.0);
        for (got, want) in [(x, case.x), (v, case.v)] {
            assert!(
                (got - want).abs() <= 4.0 * ROUND_OFF * scale,
                "{} {method}, {} steps of {} s: got {got}, want {want}",
                case.problem,
                case.steps,
                case.dt,
            );
        }
    }
}

/// The oracle lists `x(dt) - exact` to six digits. The exact value cancels in the difference between one timestep and
/// half of it, which is what can be compared; the orders then follow from the same differences.
#[test]
fn halving_the_timestep_divides_the_error_by_two_to_the_order() {
    for order in oracle().orders {
        let method: Method = order.method.parse().unwrap();
        let a = acceleration(&order.problem);
        let ends: Vec<(f64, f64)> = order
            .dts
            .iter()
            .map(|&dt| {
                let steps = (order.end / dt).round() as u32;
                run(method, a, order.x0, order.v0, dt, steps)
            })
            .collect();
        let x: Vec<f64> = ends.iter().map(|end| end.0).collect();
        let v: Vec<f64> = ends.iter().map(|end| end.1).collect();
        for (name, values, errors, orders) in [
            ("x", x, &order.err_x, &order.order_x),
            ("v", v, &order.err_v, &order.order_v),
        ] {
            let label = format!("{} {method} {name}", order.problem);
            check_errors(&label, &values, errors);
            check_order(&label, method, &values, orders);
        }
    }
}

fn check_errors(label: &str, values: &[f64], errors: &[f64]) {
    for (value, error) in values.windows(2).zip(errors.windows(2)) {
        // Six digits of each error, and the rounding of values of order 1.
        let tolerance = 1e-5 * error[0].abs() + 1e-5 * error[1].abs() + 8.0 * ROUND_OFF;
        let (got, want) = (value[0] - value[1], error[0] - error[1]);
        assert!((got - want).abs() <= tolerance, "{label}: {got}, {want}");
    }
}

fn check_order(label: &str, method: Method, values: &[f64], orders: &[Option<f64>]) {
    // An exact method has no order of convergence; the oracle marks cases with a higher order than the method's.
    let Some(&Some(expected)) = orders.last() else {
        return;
    };
    assert!(expected > f64::from(method.order()) - 0.1, "{label}");
    let [.., a, b, c] = values else {
        panic!("{label}: too few timesteps");
    };
    let observed = ((a - b) / (b - c)).log2();
    assert!(
        (observed - expected).abs() < 0.1,
        "{label}: order {observed}, expected {expected}"
    );
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
    for name in ["", "RK4", "rk 4", "euler ", "leapfrog"] {
        let error = name.parse::<Method>().unwrap_err();
        assert_eq!(
            error.to_string(),
            "must be one of euler, midpoint, verlet, rk4"
        );
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
