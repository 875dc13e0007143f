//! Requests that are refused: by the names of all fields that are wrong, or with the limit that they go beyond.

use super::{SERVICE, response, with, without};
use crate::common::Runtime;
use serde_json::json;

#[test]
fn every_bad_field_is_refused_by_name_with_empty_values() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let cases = [
        (
            "function",
            vec![json!(null), json!(5), json!(["t"]), json!("")],
        ),
        ("x0", vec![json!(null), json!("1"), json!(true), json!([1])]),
        ("xdot0", vec![json!("1"), json!(false), json!({})]),
        (
            "dt",
            vec![
                json!(0),
                json!(0.0),
                json!(-0.1),
                json!(null),
                json!("0.1"),
                json!(true),
            ],
        ),
        (
            "steps",
            vec![
                json!(0),
                json!(-3),
                json!(2.5),
                json!(null),
                json!("10"),
                json!(true),
            ],
        ),
        (
            "integrator",
            vec![json!("rk5"), json!("RK4"), json!(""), json!(4), json!(null)],
        ),
    ];
    for (field, values) in cases {
        for value in values {
            let request = with(field, value.clone());
            let response = client.call(SERVICE, request);
            assert_eq!(response["result"], false, "{field} {value}");
            assert_eq!(response["values"], json!({}), "{field} {value}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {value}: {status}");
        }
    }
    for field in ["function", "x0", "dt", "steps", "integrator"] {
        let why = client.refusal(SERVICE, without(field));
        assert!(why.contains(field), "{why}");
    }
    client.ask(SERVICE, with("x0", json!(1)));
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for field in ["x0", "xdot0", "dt", "steps"] {
        for literal in ["NaN", "Infinity", "-Infinity", "1e999"] {
            let args = with(field, json!("LITERAL"))
                .to_string()
                .replace("\"LITERAL\"", literal);
            client.send_bytes(
                format!("{{\"op\":\"call_service\",\"service\":\"{SERVICE}\",\"id\":1,\"args\":{args}}}\n")
                    .as_bytes(),
            );
            let response = response(&mut client);
            assert_eq!(response["result"], false, "{field} {literal}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {literal}: {status}");
        }
    }
}

#[test]
fn all_that_is_wrong_is_listed_at_once() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let why = client.refusal(
        SERVICE,
        json!({"function": "1 2", "x0": "a", "xdot0": [], "dt": -1, "steps": 0, "integrator": "leapfrog"}),
    );
    for field in ["function", "x0", "xdot0", "dt", "steps", "integrator"] {
        assert!(why.contains(field), "{field} is missing in {why}");
    }
    let why = client.refusal(SERVICE, json!({}));
    for field in ["function", "x0", "dt", "steps", "integrator"] {
        assert!(why.contains(field), "{field} is missing in {why}");
    }
}

#[test]
fn a_million_steps_are_taken_and_one_more_is_refused_with_the_limit() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for steps in [json!(1_000_001), json!(1e300), json!(u64::MAX)] {
        let why = client.refusal(SERVICE, with("steps", steps));
        assert!(why.contains("steps") && why.contains("1000000"), "{why}");
    }
    let values = client.ask(
        SERVICE,
        json!({"function": "t", "x0": 0, "dt": 1e-6, "steps": 1_000_000, "integrator": "verlet"}),
    );
    let positions = values["positions"].as_array().unwrap();
    assert_eq!(positions.len(), 1_000_001);
    assert_eq!(values["times"].as_array().unwrap().len(), 1_000_001);
    // Only h²/6 of the closed form above is missing: 1.7e-13.
    let last = positions.last().unwrap().as_f64().unwrap();
    assert!((last - 1.0 / 6.0).abs() < 2e-13, "{last}");
}

#[test]
fn too_much_work_is_refused_with_the_limit() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // 1001 terms and 1000 sums are 2001 nodes; 250,000 steps of 4 evaluations make 2.001e9.
    let sum = vec!["t"; 1001].join("+");
    let request = |method: &str| json!({"function": sum, "x0": 0, "dt": 1e-3, "steps": 250_000, "integrator": method});
    let why = client.refusal(SERVICE, request("rk4"));
    assert!(
        why.contains("function") && why.contains("2000000000"),
        "{why}"
    );
}
