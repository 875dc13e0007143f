//! `call_service` as the runtime itself answers it.
//!
//! **Invariant:** exactly one `service_response` for every call, whatever is wrong with it.

use crate::common::Runtime;
use pendularm::protocol::catalog::{Rosapi, Service};
use serde_json::{Value, json};

fn call(args: &str) -> String {
    format!(
        "{{\"op\":\"call_service\",\"service\":\"/arm_sim/set_integrator\",\"id\":1,\"args\":{args}}}\n"
    )
}

#[test]
fn a_response_has_all_its_members_and_the_service_as_it_was_called() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let response = client.call("/arm_sim/pause", json!({}));
    assert_eq!(
        response,
        json!({"op": "service_response", "service": "/arm_sim/pause", "id": "call-1",
            "values": {"data": false}, "result": true, "status": ""})
    );
    let response = client.call("/none", json!({}));
    assert_eq!(response["values"], json!({}));
    assert_eq!(response["result"], false);
    assert!(
        response["status"].as_str().unwrap().contains("/none"),
        "{response}"
    );
}

/// This holds for services without fields, too.
#[test]
fn every_service_refuses_arguments_of_another_form_and_too_many_of_them() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let questions = Rosapi::ALL.map(Service::Rosapi);
    for service in Service::ALL.into_iter().chain(questions) {
        let too_many = vec![1; service.fields().len() + 1];
        for args in [
            json!(5),
            json!(-0.5),
            json!("x"),
            json!(""),
            json!(true),
            json!(false),
            json!(too_many),
        ] {
            let response = client.call(service.name(), args.clone());
            let status = response["status"].as_str().unwrap();
            let is_refused = response["result"] == false && status.starts_with("args");
            assert!(is_refused, "{} {args}: {response}", service.name());
        }
    }
}

#[test]
fn arguments_that_are_absent_or_null_are_no_arguments() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for args in ["null", "{}", "[]"] {
        client.send_bytes(call(args).as_bytes());
        let response = client.receive();
        assert_eq!(response["result"], true, "{args}: {response}");
    }
    client.send(&json!({"op": "call_service", "service": "/arm_sim/set_integrator"}));
    assert_eq!(client.receive()["result"], true);
}

#[test]
fn a_positional_array_is_read_in_the_documented_order() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(call("[\"euler\", 0.002]").as_bytes());
    let response = client.receive();
    assert_eq!(
        response["values"],
        json!({"method": "euler", "timestep": 0.002})
    );
    client.send_bytes(call("[\"rk4\"]").as_bytes());
    assert_eq!(
        client.receive()["values"],
        json!({"method": "rk4", "timestep": 0.002})
    );
    let integrated = client.ask(
        "/arm_sim/integration_step",
        json!(["2", 1.0, 0.0, 0.5, 1, "rk4"]),
    );
    assert_eq!(integrated["positions"], json!([1.0, 1.25]));
}

#[test]
fn arguments_of_another_type_or_too_many_are_refused_by_name_and_change_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for args in ["7", "\"euler\"", "true", "[\"euler\", 0.002, 1]", "NaN"] {
        client.send_bytes(call(args).as_bytes());
        let response = client.receive();
        assert_eq!(response["result"], false, "{args}: {response}");
        assert!(response["values"].is_object(), "{response}");
        assert!(
            response["status"].as_str().unwrap().contains("args"),
            "{response}"
        );
    }
    assert_eq!(
        client.ask("/arm_sim/set_integrator", json!({}))["method"],
        "rk4"
    );
}

#[test]
fn every_service_of_the_table_is_answered_once_whatever_its_arguments_are() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in pendularm::protocol::catalog::Service::ALL {
        for args in [
            json!({}),
            json!(null),
            json!([]),
            json!({"data": 1, "x": "a"}),
            json!(3),
        ] {
            let response = client.call(service.name(), args);
            assert!(response["values"].is_object(), "{response}");
            let accepted = response["result"].as_bool().expect("true or false");
            let status = response["status"].as_str().expect("a text");
            assert_eq!(accepted, status.is_empty(), "{response}");
        }
    }
    // A trial is started while the controller is off, which a warning says.
    let is_answer = |frame: &Value| frame["level"] != "warning";
    let twice: Vec<&Value> = client.kept.iter().filter(|one| is_answer(one)).collect();
    assert!(twice.is_empty(), "answered twice: {twice:?}");
}

#[test]
fn a_name_that_only_resembles_a_service_is_none() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in [
        "//arm_sim/pause",
        "/arm_sim/pause/",
        "/ARM_SIM/pause",
        "/arm_sim/pause ",
        "/",
    ] {
        let status = client.refusal(service, json!({}));
        assert!(status.contains(service), "{status}");
    }
    let long = "/x".repeat(1000);
    client.send(&json!({"op": "call_service", "service": long, "id": 1}));
    let answer: Value = client.receive();
    assert!(answer.to_string().contains("service"), "{answer}");
    client.settle();
}

#[test]
fn a_number_that_is_not_finite_is_quoted_as_it_was_sent() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for literal in ["NaN", "Infinity", "-Infinity"] {
        let frame = format!(
            "{{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\",\"args\":{{\"data\":{literal}}}}}\n"
        );
        client.send_bytes(frame.as_bytes());
        let response = client.receive();
        let status = response["status"].as_str().unwrap();
        assert!(status.ends_with(&format!("got {literal}")), "{status}");
    }
}
