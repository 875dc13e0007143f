//! Frames: what is one, what is none, and that a malformed one costs nobody anything else.
//!
//! **Invariant:** whatever is sent, the connection works afterwards, and nothing inside a malformed frame is executed.

use std::net::Shutdown;

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

/// A call that must not be executed where it stands inside a malformed frame.
const SET_GRAVITY: &str =
    r#"{"op":"call_service","service":"/arm_sim/set_params","args":{"gravity":1}}"#;
const MAX_FRAME: usize = 4 * 1024 * 1024;

fn gravity(client: &mut Client) -> Value {
    client.ask("/arm_sim/set_params", json!({}))["gravity"].clone()
}

/// Sends what must be answered by `errors` error statuses and nothing else; gives their texts.
fn malformed(bytes: &[u8], errors: usize) -> Vec<String> {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(bytes);
    let texts = (0..errors)
        .map(|_| {
            let status = client.receive();
            assert_eq!(status["op"], "status", "{status}");
            assert_eq!(status["level"], "error", "{status}");
            status["msg"].as_str().expect("a text").to_owned()
        })
        .collect();
    assert_eq!(gravity(&mut client), 9.81, "something inside was executed");
    assert!(client.kept.is_empty(), "answered more: {:?}", client.kept);
    texts
}

/// A call of exactly `length` bytes: unknown members are ignored.
fn call_of_length(length: usize, id: &str) -> Vec<u8> {
    let frame = |pad: &str| {
        json!({"op": "call_service", "service": "/arm_sim/set_params", "id": id, "pad": pad})
            .to_string()
    };
    let bytes = frame(&"x".repeat(length - frame("").len())).into_bytes();
    assert_eq!(bytes.len(), length);
    bytes
}

#[test]
fn a_frame_may_end_in_carriage_return_and_newline_and_blank_lines_are_ignored() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(format!("\r\n\n  \n{SET_GRAVITY}\r\n\r\n\n").as_bytes());
    assert_eq!(client.receive()["values"]["gravity"], 1.0);
    client.settle();
    assert!(client.kept.is_empty(), "{:?}", client.kept);
}

#[test]
fn a_frame_may_come_one_byte_at_a_time() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for byte in format!("{SET_GRAVITY}\n").as_bytes() {
        client.send_bytes(&[*byte]);
    }
    assert_eq!(client.receive()["values"]["gravity"], 1.0);
}

#[test]
fn many_frames_may_come_in_one_packet() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let frames: String = (0..500)
        .map(|id| {
            format!("{{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\",\"id\":{id}}}\n")
        })
        .collect();
    client.send_bytes(frames.as_bytes());
    for id in 0..500 {
        assert_eq!(client.receive()["id"], id);
    }
}

#[test]
fn a_call_is_answered_though_no_newline_follows() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(SET_GRAVITY.as_bytes());
    assert_eq!(client.receive()["values"]["gravity"], 1.0);
    client.send_bytes(format!("{SET_GRAVITY}{SET_GRAVITY} {SET_GRAVITY}").as_bytes());
    for _ in 0..3 {
        assert_eq!(client.receive()["result"], true);
    }
}

#[test]
fn braces_and_brackets_inside_strings_do_not_count() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(
        br#"{"pad":"}]\"}{[\\","op":"call_service","service":"/arm_sim/pause","id":"}"}"#,
    );
    assert_eq!(client.receive()["id"], "}");
}

#[test]
fn every_frame_of_the_runtime_is_one_line() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "subscribe", "topic": "/joint_states"}));
    client.send(&json!({"op": "call_service", "service": "/no\nsuch", "id": "a\nb"}));
    for _ in 0..5 {
        let line = client.receive_text();
        assert!(serde_json::from_str::<Value>(&line).is_ok(), "{line:?}");
    }
}

#[test]
fn pretty_printed_json_is_malformed() {
    let pretty = "{\n  \"op\": \"call_service\",\n  \"args\": {\"gravity\": 1},\n  \"service\": \"/arm_sim/set_params\"\n}\n";
    malformed(pretty.as_bytes(), 5);
}

#[test]
fn a_line_that_opens_with_anything_else_is_one_malformed_frame() {
    for opening in [
        "garbage ", "[", "\"", "42 ", "}", "]", "null,", "/", "\u{feff}",
    ] {
        malformed(
            format!("{opening}{SET_GRAVITY}{SET_GRAVITY}\n").as_bytes(),
            1,
        );
    }
}

#[test]
fn an_object_that_its_line_does_not_complete_is_one_malformed_frame() {
    // The inner object is complete, and would be an operation by itself.
    malformed(
        format!("{{\"op\":\"call_service\",\"args\":{SET_GRAVITY}\n").as_bytes(),
        1,
    );
    malformed(format!("{{\"a\":\"{SET_GRAVITY}\n").as_bytes(), 1);
    malformed(format!("{{\"a\":]{SET_GRAVITY}\n").as_bytes(), 1);
}

#[test]
fn a_balanced_object_that_is_no_json_is_one_malformed_frame() {
    for text in [
        "{\"op\":}",
        "{op:1}",
        "{\"a\":1,}",
        "{\"a\" 1}",
        "{\"a\":01}",
        "{\"a\":+1}",
    ] {
        malformed(text.as_bytes(), 1);
    }
}

#[test]
fn bad_utf8_is_one_malformed_frame() {
    malformed(b"{\"op\":\"\xff\xfe\"}\n", 1);
    malformed(b"\xc3\x28 no object\n", 1);
}

#[test]
fn an_object_without_a_string_op_is_told_that() {
    for frame in [
        "{}\n",
        "{\"op\":7}",
        "{\"op\":null}",
        "{\"op\":{\"op\":\"publish\"}}",
    ] {
        let texts = malformed(frame.as_bytes(), 1);
        assert!(texts[0].contains("op"), "{texts:?}");
    }
}

#[test]
fn a_frame_of_four_mebibytes_is_accepted() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(&call_of_length(MAX_FRAME, "longest"));
    assert_eq!(client.receive()["id"], "longest");
}

#[test]
fn a_longer_frame_gets_one_error_and_is_skipped_to_its_end() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for surplus in [1, 10_000_000] {
        client.send_bytes(&call_of_length(MAX_FRAME + surplus, "too long"));
        // No newline: it would have ended where its braces balance.
        client.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "id": "next"}));
        let status = client.receive();
        assert_eq!(
            (&status["op"], &status["level"]),
            (&json!("status"), &json!("error"))
        );
        assert!(
            status["msg"].as_str().unwrap().contains("4194304"),
            "{status}"
        );
        assert_eq!(client.receive()["id"], "next");
    }
    // The same for a line that is no object, and one whose newline comes first.
    client.send_bytes(&[b'x'; 5_000_000]);
    client.send_bytes(format!("{SET_GRAVITY}\n").as_bytes());
    assert_eq!(client.receive()["level"], "error");
    let mut cut = call_of_length(MAX_FRAME + 9, "too long");
    cut.truncate(MAX_FRAME + 5);
    client.send_bytes(&cut);
    client.send_bytes(b"\n");
    assert_eq!(client.receive()["level"], "error");
    assert_eq!(gravity(&mut client), 9.81);
    assert!(client.kept.is_empty(), "{:?}", client.kept);
}

#[test]
fn deep_nesting_is_a_malformed_frame_and_never_a_stack_overflow() {
    for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
        let deep = format!(
            "{{\"a\":{}1{}}}",
            open.repeat(300_000),
            close.repeat(300_000)
        );
        malformed(deep.as_bytes(), 1);
    }
    // Cut off in the middle, by a newline.
    malformed(format!("{{\"a\":{}\n", "[".repeat(1_000_000)).as_bytes(), 1);
}

#[test]
fn a_frame_that_the_stream_cuts_off_is_malformed() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(b"{\"op\":\"call_service\",\"args\":{}");
    client.stream().shutdown(Shutdown::Write).unwrap();
    assert_eq!(client.receive()["level"], "error");
    assert!(client.is_closed());
}

#[test]
fn unknown_fields_are_ignored() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes(
        br#"{"zzz":[1,{"op":"nonsense"}],"op":"call_service","service":"/arm_sim/pause","id":1,"qos":{}}"#,
    );
    assert_eq!(client.receive()["result"], true);
}

#[test]
fn numbers_that_are_not_finite_are_rejected_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for number in ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"] {
        client.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"id\":1,\"args\":{{\"gravity\":{number},\"masses\":[1,{number}],\"lengths\":[2,2]}}}}\n")
                .as_bytes(),
        );
        let response = client.receive();
        assert_eq!(response["result"], false, "{response}");
        let status = response["status"].as_str().unwrap();
        assert!(
            status.contains("gravity") && status.contains("masses"),
            "{status}"
        );
        assert_eq!(
            response["values"]["lengths"],
            json!([2.0, 2.0]),
            "{response}"
        );
    }
}

#[test]
fn payloads_pass_untouched_but_for_numbers_that_are_not_finite() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "advertise", "topic": "/t"}));
    client.subscribe("/t");
    let sent = r#"{ "a" : 1.000000000000000000000000001 ,"b":[NaN,1E5,-Infinity, 1e-400 ], "b":Infinity,"NaN":"NaN 1e999","c":123456789012345678901234567890,"d":"\u00e9\/é","e":-1e999}"#;
    let strict = r#"{ "a" : 1.000000000000000000000000001 ,"b":[null,1E5,null, 1e-400 ], "b":null,"NaN":"NaN 1e999","c":123456789012345678901234567890,"d":"\u00e9\/é","e":null}"#;
    client
        .send_bytes(format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{sent}}}\n").as_bytes());
    assert_eq!(
        client.receive_text(),
        format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{strict}}}")
    );
}

#[test]
fn arguments_and_values_of_forwarded_calls_pass_in_the_same_way() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "advertise_service", "service": "/s"}));
    client.status();
    client.send_bytes(
        b"{\"op\":\"call_service\",\"service\":\"/s\",\"id\":1,\"args\":{\"x\": NaN, \"y\":1E2}}\n",
    );
    let line = client.receive_text();
    assert!(line.contains("{\"x\": null, \"y\":1E2}"), "{line}");
    let call: Value = serde_json::from_str(&line).unwrap();
    client.send_bytes(
        format!(
            "{{\"op\":\"service_response\",\"service\":\"/s\",\"id\":{},\"result\":true,\"values\":{{\"z\": -1e999, \"w\":1.50}}}}\n",
            call["id"]
        )
        .as_bytes(),
    );
    let line = client.receive_text();
    assert!(line.contains("{\"z\": null, \"w\":1.50}"), "{line}");
}
