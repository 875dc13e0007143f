//! The field `function`: texts that parse and what they come to, and texts that don't.

use super::{SERVICE, with};
use crate::common::Runtime;
use serde_json::json;

#[test]
fn what_does_not_parse_is_refused_and_later_calls_work() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for function in [
        "",
        "   ",
        "(",
        ")",
        "(t",
        "t)",
        "()",
        "1 2",
        "t t",
        "2t",
        "t(1)",
        "sin",
        "sin t",
        "sin()",
        "sin(t",
        "sin(t,t)",
        "foo(t)",
        "x",
        "pi",
        "e",
        "T",
        "t +",
        "* t",
        "t ** 2",
        "+t",
        "t + +1",
        "1..2",
        ".",
        "1e",
        "1e+",
        "t # 1",
        "t; t",
        "t$",
        "0x10",
        "é",
        "t\u{0}",
        "∞",
        "1,5",
        "t=1",
        "tan",
        "sqrt4",
        "--",
        "t-",
        "((((((t)))))",
        "\"t\"",
        "t\n\n)",
    ] {
        let why = client.refusal(SERVICE, with("function", json!(function)));
        assert!(why.contains("function"), "{function:?}: {why}");
    }
    client.ask(SERVICE, with("function", json!("t^2 + 3*t - 1")));
}

#[test]
fn the_grammar_is_the_specifications() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // With dt = 1 one step of Euler from rest ends with v = f(0).
    for (function, value) in [
        ("2^3^2", 512.0),
        ("2-3-4", -5.0),
        ("16/4/2", 2.0),
        ("-2^2", 4.0),
        ("2+3*4", 14.0),
        ("--3", 3.0),
        ("2^-1", 0.5),
        ("(2+3)*4", 20.0),
        (".5 + 5. + 1e3 + 2.5E-2", 1005.525),
        (
            "cos (t) + exp(t) + sqrt(4) + ln(1) + abs(-3) + tan(0) + sin(0)",
            7.0,
        ),
    ] {
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": 0, "dt": 1, "steps": 1, "integrator": "euler"}),
        );
        assert_eq!(values["velocities"][1], json!(value), "{function}");
    }
}

#[test]
fn results_that_are_not_finite_are_null() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for function in ["sqrt(-1)", "1/t", "ln(t)", "exp(1000)", "0/0", "1e308*10"] {
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": 3, "xdot0": 0, "dt": 1, "steps": 2, "integrator": "euler"}),
        );
        assert_eq!(values["times"], json!([0.0, 1.0, 2.0]), "{function}");
        assert_eq!(values["velocities"], json!([0.0, null, null]), "{function}");
        assert_eq!(values["positions"], json!([3.0, 3.0, null]), "{function}");
    }
    // Times beyond the largest number are no number either.
    let values = client.ask(
        SERVICE,
        json!({"function": "0", "x0": 3, "dt": 1e308, "steps": 2, "integrator": "euler"}),
    );
    assert_eq!(values["times"], json!([0.0, 1e308, null]));
}

#[test]
fn an_expression_of_a_megabyte_is_no_trouble() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let request = |function: String| json!({"function": function, "x0": 0, "dt": 1, "steps": 1, "integrator": "euler"});
    let sum = vec!["1"; 524_288].join("+");
    assert!(sum.len() > 1_000_000);
    let values = client.ask(SERVICE, request(sum));
    assert_eq!(values["velocities"][1], 524_288.0);
    for deep in [
        format!("{}1{}", "(".repeat(500_000), ")".repeat(500_000)),
        format!("{}1", "-".repeat(1_000_000)),
        format!("{}1{}", "sin(".repeat(200_000), ")".repeat(200_000)),
        vec!["1"; 500_000].join("^"),
    ] {
        // Taken or refused by a limit, but answered.
        client.call(SERVICE, request(deep));
    }
    for bad in [
        "(".repeat(1_000_000),
        ")".repeat(1_000_000),
        "1 ".repeat(500_000),
    ] {
        let why = client.refusal(SERVICE, request(bad));
        assert!(
            why.len() < 4096,
            "an error quotes an excerpt: {}",
            why.len()
        );
    }
    client.ask(SERVICE, with("x0", json!(1)));
}
