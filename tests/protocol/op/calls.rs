//! The arguments and the timeout of a service call.

use std::time::Duration;

use pendularm::protocol::op::{Arguments, CallService, MAX_TIMEOUT, Op};

use super::op;

fn call(more: &str) -> CallService {
    match op(&format!(r#"{{"op":"call_service","service":"/x"{more}}}"#)) {
        Op::CallService(call) => call,
        other => panic!("{other:?}"),
    }
}

#[test]
fn absent_arguments_are_an_empty_object() {
    for more in ["", r#","args":null"#, r#","args":{}"#] {
        assert!(
            matches!(call(more).args, Arguments::Object(raw) if raw.get() == "{}"),
            "{more}"
        );
    }
    assert!(
        matches!(call(r#","args":{"a":1}"#).args, Arguments::Object(raw) if raw.get() == r#"{"a":1}"#)
    );
    assert!(
        matches!(call(r#","args":[1]"#).args, Arguments::Positional(raw) if raw.get() == "[1]")
    );
}

#[test]
fn arguments_of_another_type_are_left_to_whoever_takes_the_call() {
    for bad in ["5", "\"x\"", "true", "false"] {
        let args = call(&format!(r#","args":{bad}"#)).args;
        assert!(
            matches!(args, Arguments::Neither(raw) if raw.get() == bad),
            "{bad}"
        );
    }
}

#[test]
fn a_timeout_is_a_positive_number_of_seconds_and_bounded() {
    assert_eq!(call("").timeout, None);
    assert_eq!(
        call(r#","timeout":1.5"#).timeout,
        Some(Duration::from_millis(1500))
    );
    assert_eq!(call(r#","timeout":1e300"#).timeout, Some(MAX_TIMEOUT));
    // A day.
    assert_eq!(MAX_TIMEOUT, Duration::from_secs(86_400));
}
