//! `/arm_sim/set_integrator` from outside.

use crate::common::Runtime;
use pendularm::math::integrator::Method;
use serde_json::{Value, json};

const SERVICE: &str = "/arm_sim/set_integrator";

#[test]
fn the_defaults_are_runge_kutta_at_a_millisecond() {
    for links in [2, 3] {
        let values = Runtime::with_links(links).connect().ask(SERVICE, json!({}));
        assert_eq!(values, json!({"method": "rk4", "timestep": 0.001}));
    }
}

#[test]
fn each_field_is_optional_and_the_answer_echoes_both() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for method in Method::ALL.map(Method::name) {
        let values = client.ask(SERVICE, json!({"method": method}));
        assert_eq!(values, json!({"method": method, "timestep": 0.001}));
    }
    let values = client.ask(SERVICE, json!({"timestep": 0.002}));
    assert_eq!(values, json!({"method": "rk4", "timestep": 0.002}));
    let values = client.ask(SERVICE, json!({"method": "euler", "timestep": 1}));
    assert_eq!(values, json!({"method": "euler", "timestep": 1.0}));
    for request in [json!({}), Value::Null, json!([]), json!({"other": [1]})] {
        assert_eq!(
            client.ask(SERVICE, request),
            values,
            "a query changes nothing"
        );
    }
}

#[test]
fn another_client_sees_what_one_has_set() {
    let runtime = Runtime::start();
    runtime.connect().ask(SERVICE, json!({"method": "verlet"}));
    let values = runtime.connect().ask(SERVICE, json!({}));
    assert_eq!(values["method"], "verlet");
}

#[test]
fn an_unknown_method_is_refused_by_name_and_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let methods = [
        json!("rk5"),
        json!("RK4"),
        json!(" rk4"),
        json!(""),
        json!(4),
        json!(null),
        json!(["rk4"]),
        json!(true),
    ];
    for method in methods {
        let response = client.call(SERVICE, json!({"method": method}));
        assert_eq!(response["result"], false, "{method}");
        assert_eq!(
            response["values"],
            json!({"method": "rk4", "timestep": 0.001})
        );
        let status = response["status"].as_str().unwrap();
        assert!(
            status.contains("method") && !status.contains("timestep"),
            "{status}"
        );
    }
}

#[test]
fn a_timestep_that_is_no_positive_number_is_refused_by_name_and_changes_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for literal in [
        "0",
        "0.0",
        "-0.0",
        "-0.001",
        "null",
        "\"0.01\"",
        "true",
        "[0.01]",
        "{}",
        "NaN",
        "Infinity",
        "-Infinity",
        "1e999",
        "-1e999",
        "1e-400",
    ] {
        client.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"{SERVICE}\",\"args\":{{\"timestep\":{literal}}}}}\n").as_bytes(),
        );
        let response = client.receive();
        assert_eq!(response["result"], false, "{literal}");
        assert_eq!(
            response["values"],
            json!({"method": "rk4", "timestep": 0.001}),
            "{literal}"
        );
        let status = response["status"].as_str().unwrap();
        assert!(status.contains("timestep"), "{literal}: {status}");
    }
}

#[test]
fn a_valid_field_takes_effect_beside_a_rejected_one() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let response = client.call(SERVICE, json!({"method": "leapfrog", "timestep": 0.005}));
    assert_eq!(response["result"], false);
    assert_eq!(
        response["values"],
        json!({"method": "rk4", "timestep": 0.005})
    );
    let response = client.call(SERVICE, json!({"method": "midpoint", "timestep": -1}));
    assert_eq!(response["result"], false);
    assert_eq!(
        response["values"],
        json!({"method": "midpoint", "timestep": 0.005})
    );
    let why = client.refusal(SERVICE, json!({"method": 1, "timestep": "x"}));
    assert!(why.contains("method") && why.contains("timestep"), "{why}");
}

#[test]
fn values_may_come_by_position_but_not_too_many() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let values = client.ask(SERVICE, json!(["euler", 0.002]));
    assert_eq!(values, json!({"method": "euler", "timestep": 0.002}));
    let response = client.call(SERVICE, json!(["rk4", 0.001, 1]));
    assert_eq!(response["result"], false);
    assert!(
        response["status"].as_str().unwrap().contains("args"),
        "{response}"
    );
    assert_eq!(
        response["values"], values,
        "nothing has changed, and the answer says so"
    );
}
