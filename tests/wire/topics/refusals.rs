//! Ops that are none, and those whose fields are missing or of another type.

use super::error;
use crate::common::Runtime;
use serde_json::{Value, json};

#[test]
fn an_unknown_op_is_one_error_that_names_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for op in ["nonsense", "", "Publish", "publish ", "set_levels"] {
        let text = error(&mut client, &json!({"op": op, "id": 1, "topic": "/t"}));
        assert!(text.contains(op), "{text}");
    }
}

#[test]
fn a_required_field_that_is_missing_or_mistyped_is_one_error_that_names_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let whole = [
        (json!({"op": "advertise", "topic": "/t"}), vec!["topic"]),
        (json!({"op": "unadvertise", "topic": "/t"}), vec!["topic"]),
        (
            json!({"op": "publish", "topic": "/t", "msg": {}}),
            vec!["topic", "msg"],
        ),
        (json!({"op": "subscribe", "topic": "/t"}), vec!["topic"]),
        (json!({"op": "unsubscribe", "topic": "/t"}), vec!["topic"]),
        (
            json!({"op": "advertise_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "unadvertise_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "call_service", "service": "/s"}),
            vec!["service"],
        ),
        (
            json!({"op": "service_response", "service": "/s", "values": {}, "result": true}),
            vec!["service", "values", "result"],
        ),
    ];
    for (frame, fields) in whole {
        for field in fields {
            for value in [None, Some(json!(7)), Some(Value::Null)] {
                if field == "values" && value.is_some() {
                    continue; // any value will do
                }
                let mut bad = frame.clone();
                bad["id"] = json!("pendularm:1");
                match value {
                    None => drop(bad.as_object_mut().unwrap().remove(field)),
                    Some(value) => bad[field] = value,
                }
                let text = error(&mut client, &bad);
                assert!(text.contains(field), "{bad}: {text}");
            }
        }
    }
    let response = json!({"op": "service_response", "service": "/s", "values": {}, "result": true});
    assert!(error(&mut client, &response).contains("id"));
}
