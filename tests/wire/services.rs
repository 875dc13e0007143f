//! `call_service` as the runtime itself answers it.
//!
//! **Invariant:** exactly one `service_response` for every call, whatever is wrong with it.

use crate::common::Runtime;
use serde_json::{Value, json};

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
