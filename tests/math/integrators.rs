//! The one-step methods: their evaluations, and how exact they are, against 50-digit values.

use std::cell::Cell;

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

/// One problem, method and timestep; `x1`, `v1` after the first step, `x`, `v` after the last.
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
    x1: f64,
    v1: f64,
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

/// The largest of the terms that the first step adds up, for position and for velocity: what it is off is counted in
/// units of their last place.
fn largest_terms(case: &Case, method: Method, a: Acceleration) -> (f64, f64) {
    let speed = Cell::new(0.0_f64);
    let push = Cell::new(0.0_f64);
    let recorded = |t: f64, [x]: &[f64; 1], [v]: &[f64; 1]| {
        let value = a(t, *x, *v);
        speed.set(speed.get().max(v.abs()));
        push.set(push.get().max(value.abs()));
        [value]
    };
    increment(method, recorded, 0.0, &[case.x0], &[case.v0], case.dt);
    (
        case.x0.abs().max(case.dt * speed.get()),
        case.v0.abs().max(case.dt * push.get()),
    )
}

#[test]
fn every_first_step_agrees_with_50_digits_to_two_units_in_the_last_place() {
    for case in oracle().cases {
        let method: Method = case.method.parse().unwrap();
        let a = acceleration(&case.problem);
        let (x, v) = run(method, a, case.x0, case.v0, case.dt, 1);
        let (x_term, v_term) = largest_terms(&case, method, a);
        for (got, want, term) in [(x, case.x1, x_term), (v, case.v1, v_term)] {
            assert!(
                (got - want).abs() <= 2.0 * f64::EPSILON * term,
                "{} {method} at {} s: got {got}, want {want}",
                case.problem,
                case.dt,
            );
        }
    }
}

/// Compensated sums leave the rounding of the increments, which is relative to their size, and that of the final sum:
/// a few half units however many steps there are.
#[test]
fn a_thousand_steps_agree_with_50_digits_as_well_as_one() {
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
    // Where the method is exact there is no order; where it converges faster than it promises the oracle says so.
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
fn every_method_evaluates_as_often_as_it_says_and_at_the_times_its_stages_stand_for() {
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

/// With `a = x + 10 v + 100 t` at `x = 1, v = 2, t = 0, h = 1`, by hand. Exact in floating point except for the last.
#[test]
fn one_step_of_each_method_is_what_its_map_says() {
    let a = |t: f64, [x]: &[f64; 1], [v]: &[f64; 1]| [x + 10.0 * v + 100.0 * t];
    for (method, dx, dv) in [
        // a1 = 21
        (Method::Euler, 2.0, 21.0),
        // xm = 2, vm = 12.5: 2 + 125 + 50
        (Method::Midpoint, 12.5, 177.0),
        // x' = 1 + 2 + 10.5 = 13.5, v' = 23: a2 = 13.5 + 230 + 100 = 343.5
        (Method::Verlet, 12.5, 182.25),
        // v2 = 12.5, a2 = 177; v3 = 90.5, x3 = 7.25, a3 = 962.25; v4 = 964.25, x4 = 91.5, a4 = 9834
        (Method::Rk4, 1172.25 / 6.0, 12133.5 / 6.0),
    ] {
        let ([got_dx], [got_dv]) = increment(method, a, 0.0, &[1.0], &[2.0], 1.0);
        assert!((got_dx - dx).abs() <= 2.0 * f64::EPSILON * dx, "{method}");
        assert!((got_dv - dv).abs() <= 2.0 * f64::EPSILON * dv, "{method}");
    }
}

/// A quadrature of order p is exact on polynomials up to degree p - 1: Euler's rectangle on constants, the midpoint and
/// the trapezium (Verlet) on linear forces, Simpson's rule (Runge-Kutta 4) on cubic ones. Freezing `t` over the step
/// would spoil all but the first.
#[test]
fn each_method_integrates_the_polynomials_of_its_order_exactly_and_no_more() {
    for (method, degree) in [
        (Method::Euler, 0),
        (Method::Midpoint, 1),
        (Method::Verlet, 1),
        (Method::Rk4, 3),
    ] {
        for power in 0..=4 {
            let force = |t: f64, _: &[f64; 1], _: &[f64; 1]| [t.powi(power)];
            let (_, [dv]) = increment(method, force, 1.0, &[0.0], &[0.0], 0.5);
            let exact = (1.5_f64.powi(power + 1) - 1.0) / f64::from(power + 1);
            let off = (dv - exact).abs();
            if power <= degree {
                assert!(off <= 2.0 * f64::EPSILON, "{method}, t^{power}: {off}");
            } else {
                assert!(off > 1e-4, "{method}, t^{power}: {off}");
            }
        }
    }
}

#[test]
fn joints_that_do_not_act_on_each_other_move_as_if_alone() {
    let alone = |t: f64, [q]: &[f64; 1], [v]: &[f64; 1]| [t.cos() - 3.0 * q - 0.5 * v];
    let q = [0.3, -1.5, 2.25];
    let v = [-0.7, 0.1, 5.5];
    for method in Method::ALL {
        let together = |t: f64, q: &[f64; 3], v: &[f64; 3]| {
            std::array::from_fn(|i| alone(t, &[q[i]], &[v[i]])[0])
        };
        let (dq, dv) = increment(method, together, 0.4, &q, &v, 0.01);
        for i in 0..3 {
            let one = increment(method, alone, 0.4, &[q[i]], &[v[i]], 0.01);
            assert_eq!(([dq[i]], [dv[i]]), one, "{method}");
        }
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
