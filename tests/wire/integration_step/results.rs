//! The numbers of an answer, and the requests that have one.

use super::{SERVICE, response, with, without};
use crate::arm::numbers;
use crate::common::Runtime;
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;
use serde_json::{Value, json};

#[test]
fn each_method_gives_what_fifty_digits_give() {
    let oracle: Value = serde_json::from_str(include_str!("../../data/integrators.json")).unwrap();
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut compared = 0;
    for case in oracle["cases"].as_array().unwrap() {
        if case["depends_on"] != "t" {
            continue;
        }
        let function = case["acceleration"]
            .as_str()
            .unwrap()
            .replace(" (the float64)", "");
        let number = |field: &str| case[field].as_f64().unwrap();
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": number("x0"), "xdot0": number("v0"), "dt": number("dt"),
                "steps": case["steps"], "integrator": case["method"]}),
        );
        // The sum is compensated, so half an ulp of the result and some roundings in the last step remain: 3 units of
        // 2^-53 max(|x|, |v|, 1), as in the test of the particle itself. Nothing may get lost on the way through JSON.
        let scale = number("x").abs().max(number("v").abs()).max(1.0);
        let tolerance = 1.5 * f64::EPSILON * scale;
        for (array, wanted) in [("positions", "x"), ("velocities", "v")] {
            let last = *numbers(&values[array]).last().unwrap();
            assert!((last - number(wanted)).abs() <= tolerance, "{last} {case}");
        }
        compared += 1;
    }
    assert_eq!(compared, 7 * 4 * 11, "7 forces, 4 methods, 11 grids");
}

/// `f(t) = t` from rest is `x = t³/6`, `v = t²/2`. Summing each method's increments over `n` steps of `h`:
/// Euler `x = h³ n(n-1)(n-2)/6`, `v = h² n(n-1)/2`; those of order 2 are exact in `v` and miss `h³/6` of `x` in every
/// step; Runge-Kutta is exact. A method that freezes `t` over the step has Euler's `v`.
#[test]
fn every_stage_is_evaluated_at_its_own_time() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let (n, h): (f64, f64) = (10.0, 0.1);
    let t = n * h;
    let euler = (
        h.powi(3) * n * (n - 1.0) * (n - 2.0) / 6.0,
        h * h * n * (n - 1.0) / 2.0,
    );
    let second = (t.powi(3) / 6.0 - t * h * h / 6.0, t * t / 2.0);
    let exact = (t.powi(3) / 6.0, t * t / 2.0);
    for method in Method::ALL {
        let (x, v) = match method.order() {
            1 => euler,
            2 => second,
            _ => exact,
        };
        let values = client.ask(SERVICE, with("integrator", json!(method.name())));
        let last = |array: &str| *numbers(&values[array]).last().unwrap();
        // Ten steps of numbers up to 1, and the roundings of the formula above: some ulp of 1.
        assert!((last("positions") - x).abs() < 1e-15, "{method}");
        assert!((last("velocities") - v).abs() < 1e-15, "{method}");
    }
}

#[test]
fn the_answer_starts_at_the_start_and_has_one_entry_more_than_steps() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let values = client.ask(
        SERVICE,
        json!({"function": "0", "x0": 0.25, "xdot0": -2, "dt": 0.1, "steps": 30, "integrator": "euler"}),
    );
    assert_eq!(values.as_object().unwrap().len(), 3, "{values}");
    let times = numbers(&values["times"]);
    let expected: Vec<f64> = (0..=30).map(|k| f64::from(k) * 0.1).collect();
    assert_eq!(times, expected, "products, not a running sum");
    assert_eq!(numbers(&values["positions"]).len(), 31);
    assert_eq!(numbers(&values["velocities"]), vec![-2.0; 31]);
    assert_eq!(values["positions"][0], 0.25);
}

#[test]
fn what_is_printed_reads_back_as_the_same_bits() {
    let runtime = Runtime::start();
    let args = json!({"function": "sin(5*t)*exp(-t)", "x0": 1, "xdot0": -1, "dt": 0.001, "steps": 5000,
        "integrator": "rk4"});
    let values = runtime.connect().ask(SERVICE, args);
    let function = Expression::parse("sin(5*t)*exp(-t)").unwrap();
    let mut particle = Particle::new(function, 1.0, -1.0, 0.001, 5000, Method::Rk4).unwrap();
    particle.advance(5000);
    let times: Vec<f64> = particle.times().collect();
    let expected = json!({"times": times, "positions": particle.positions(),
        "velocities": particle.velocities()});
    assert_eq!(values, expected);
}

#[test]
fn the_starting_velocity_is_zero_where_it_is_absent_or_null() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for request in [without("xdot0"), with("xdot0", Value::Null)] {
        let values = client.ask(SERVICE, request);
        assert_eq!(values["velocities"][0], 0.0);
    }
}

#[test]
fn whole_floats_count_as_steps() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for text in ["10", "10.0", "1e1", "100e-1"] {
        let frame = format!(
            r#"{{"op":"call_service","service":"{SERVICE}","id":"{text}","args":{{"function":"t","x0":0,"dt":1,"steps":{text},"integrator":"rk4"}}}}"#
        );
        client.send_bytes(format!("{frame}\n").as_bytes());
        let response = response(&mut client);
        assert_eq!(response["id"], text);
        assert_eq!(numbers(&response["values"]["times"]).len(), 11, "{text}");
    }
}

#[test]
fn arguments_may_come_by_position() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let named = client.ask(SERVICE, with("xdot0", json!(2.5)));
    let positional = client.ask(SERVICE, json!(["t", 0.0, 2.5, 0.1, 10, "rk4"]));
    assert_eq!(named, positional);
    let why = client.refusal(SERVICE, json!(["t", 0.0, 2.5, 0.1, 10, "rk4", 1]));
    assert!(why.contains("args"), "{why}");
}
