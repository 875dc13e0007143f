//! `id` is any JSON value, and comes back exactly as it was sent.
//!
//! **Invariant:** the ids are compared as text: a parser would hide what a number lost.

use crate::common::Runtime;

/// Ids whose digits, spaces, order and escapes must survive.
const IDS: [&str; 11] = [
    "\"a\"",
    "7",
    "-0.0",
    "1.50",
    "123456789012345678901234567890",
    "18446744073709551616",
    "null",
    "true",
    "{\"b\": 1, \"a\":[1E2,null]}",
    "[ ]",
    "\"\\u00e9 \\/ é\"",
];

#[test]
fn a_response_carries_the_id_as_it_came() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in ["/arm_sim/set_params", "/no_such_service"] {
        for id in IDS {
            let call = format!("{{\"op\":\"call_service\",\"service\":\"{service}\",\"id\":{id}}}");
            client.send_bytes(call.as_bytes());
            let line = client.receive_text();
            assert!(line.contains(&format!("\"id\":{id},")), "{id} in {line}");
        }
    }
}

#[test]
fn the_response_to_a_computation_carries_the_id_as_it_came() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for id in IDS {
        client.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"/arm_sim/integration_step\",\"id\":{id},\"args\":{{\"function\":\"t\",\"x0\":0,\"dt\":1,\"steps\":1,\"integrator\":\"rk4\"}}}}").as_bytes(),
        );
        let line = client.receive_text();
        assert!(line.contains(&format!("\"id\":{id},")), "{id} in {line}");
        assert!(line.contains("\"result\":true"), "{line}");
    }
}

#[test]
fn a_status_carries_the_id_of_the_frame_that_it_answers() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let frames = [
        "\"op\":\"subscribe\",\"topic\":\"/t\"",
        "\"op\":\"advertise_service\",\"service\":\"/s\"",
        "\"op\":\"nonsense\"",
        "\"op\":\"subscribe\"",
        "\"op\":\"advertise\",\"topic\":\"/joint_states\"",
        "\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{}",
        "\"noop\":1",
    ];
    for frame in frames {
        for id in IDS {
            client.send_bytes(format!("{{{frame},\"id\":{id}}}\n").as_bytes());
            let line = client.receive_text();
            assert!(line.contains("\"op\":\"status\""), "{line}");
            assert!(line.ends_with(&format!("\"id\":{id}}}")), "{id} in {line}");
        }
    }
}

#[test]
fn a_forwarded_call_comes_back_under_the_callers_own_id() {
    let runtime = Runtime::start();
    let (mut caller, mut provider) = (runtime.connect(), runtime.connect());
    provider.send_bytes(b"{\"op\":\"advertise_service\",\"service\":\"/s\"}");
    provider.status();
    for id in IDS {
        caller.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"/s\",\"id\":{id}}}").as_bytes(),
        );
        let call = provider.receive();
        assert!(call["id"].is_string(), "an id of the runtime's own: {call}");
        provider.send_bytes(
            format!("{{\"op\":\"service_response\",\"service\":\"/s\",\"id\":{},\"values\":{{}},\"result\":true}}", call["id"]).as_bytes(),
        );
        let line = caller.receive_text();
        assert!(line.contains(&format!("\"id\":{id},")), "{id} in {line}");
    }
}
