//! Services of clients that answer badly.
//!
//! **Invariant:** a bad answer fails its own call at once, and no other call.

use crate::common::{Client, Runtime, forwarded, provide, respond};
use crate::external_services::{call, failure};
use pendularm::protocol::limits::MAX_FRAME;
use serde_json::{Value, json};

/// The answers of broken providers, and why they are discarded. `ID` stands for the id of the call, `LONG` for what is
/// longer than a frame, `DEEP` for too many brackets. Only one call waits, so it is known without an id, too.
const BROKEN: [(&str, &str); 20] = [
    (r#"{NAMED,"result":true}"#, "values is required"),
    (
        r#"{NAMED,"result":false,"status":"x"}"#,
        "values is required",
    ),
    (r#"{NAMED,"values":{}}"#, "result is required"),
    (
        r#"{NAMED,"values":{},"result":"true"}"#,
        "result must be true or false",
    ),
    (
        r#"{NAMED,"values":{},"result":1}"#,
        "result must be true or false",
    ),
    (
        r#"{NAMED,"values":[1],"result":true}"#,
        "values must be an object",
    ),
    (
        r#"{NAMED,"values":null,"result":true}"#,
        "values must be an object",
    ),
    (r#"{OP,"id":ID,REST}"#, "service is required"),
    (r#"{OP,"id":ID,"service":7,REST}"#, "service must be"),
    (r#"{OP,"id":ID,"service":"/t",REST}"#, "is of /s"),
    (r#"{OP,"service":"s",REST}"#, "id is required"),
    (r"{OP,REST}", "id is required"),
    (
        r#"{NAMED,"values":{'a':1},"result":true}"#,
        "malformed frame",
    ),
    (
        r#"{NAMED,"values":{"a":1,},"result":true}"#,
        "malformed frame",
    ),
    (r#"{NAMED,"values":[1},"result":true}"#, "malformed frame"),
    ("{NAMED,\n\"values\":{},\"result\":true}", "malformed frame"),
    (r#"{OP,"service":"/s","values":{oops}}"#, "malformed frame"),
    (r#"{NAMED,"values":DEEP}"#, "nested deeper"),
    (r#"{NAMED,"values":"LONG"}"#, "frame longer than"),
    (
        r#"{OP,"service":"/s","values":"LONG","id":ID}"#,
        "frame longer than",
    ),
];

/// The caller would wait for a day.
#[test]
fn an_answer_that_cannot_be_passed_on_fails_its_call_at_once_and_is_its_providers_error() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    for (number, (pattern, why)) in BROKEN.iter().enumerate() {
        let id = json!(number);
        caller.send(&json!({"op": "call_service", "service": "/s", "id": id, "timeout": 86400}));
        let known_as = forwarded(&mut provider)["id"].to_string();
        let frame = pattern
            .replace("NAMED", r#"OP,"service":"/s","id":ID"#)
            .replace("OP", r#""op":"service_response""#)
            .replace("REST", r#""values":{},"result":true"#)
            .replace("ID", &known_as)
            .replace("DEEP", &"[".repeat(200))
            .replace("LONG", &"x".repeat(MAX_FRAME));
        provider.send_bytes((frame + "\n").as_bytes());
        let status = failure(&mut caller, &id);
        assert!(
            status.contains("the answer of /s") && status.contains(why),
            "{pattern}: {status}"
        );
        let told = provider.status();
        let told = told["msg"].as_str().expect("a text");
        assert!(told.contains(why), "{pattern}: {told}");
        // The rest of a frame over several lines is malformed too.
        provider.settle();
        provider.kept.clear();
    }
    caller.settle();
    assert!(caller.kept.is_empty(), "answered twice: {:?}", caller.kept);
}

/// Without an id it could be either, and an id of nobody's is nobody's.
#[test]
fn a_bad_answer_fails_no_call_but_its_own() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    let mut other = runtime.connect();
    provide(&mut provider, "/s");
    provide(&mut provider, "/t");
    call(&mut caller, "/s", json!(1));
    let first = forwarded(&mut provider);
    let bad = |client: &mut Client, frame: Value| {
        client.send(&frame);
        assert_eq!(client.status()["level"], "error", "{frame}");
    };
    let op = "service_response";
    bad(
        &mut other,
        json!({"op": op, "service": "/s", "id": first["id"], "result": true}),
    );
    bad(
        &mut other,
        json!({"op": op, "service": "/s", "values": {}, "result": true}),
    );
    bad(&mut caller, json!({"op": op, "id": first["id"]}));
    bad(
        &mut provider,
        json!({"op": op, "service": "/t", "values": {}, "result": true}),
    );
    bad(
        &mut provider,
        json!({"op": op, "service": "/s", "id": null}),
    );
    bad(
        &mut provider,
        json!({"op": op, "service": "/s", "id": "pendularm:999"}),
    );
    bad(
        &mut provider,
        json!({"op": "action_result", "action": "/s", "id": first["id"]}),
    );
    call(&mut caller, "/s", json!(2));
    let second = forwarded(&mut provider);
    bad(
        &mut provider,
        json!({"op": op, "service": "/s", "values": {}, "result": true}),
    );
    for frame in [&first, &second] {
        respond(&mut provider, frame, json!({}));
        let response = caller.receive();
        assert_eq!(response["result"], true, "{response}");
    }
}

#[test]
fn an_answer_in_pieces_is_passed_on_and_one_that_is_too_long_fails_its_call() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    for (length, pieces) in [(1000, 3), (MAX_FRAME, 8)] {
        caller.send(&json!({"op": "call_service", "service": "/s", "id": 1, "timeout": 86400}));
        let id = forwarded(&mut provider)["id"].clone();
        let answer = json!({"op": "service_response", "id": id, "result": true, "service": "/s",
            "values": {"x": "x".repeat(length)}});
        let text = answer.to_string();
        let parts: Vec<_> = text
            .as_bytes()
            .chunks(text.len().div_ceil(pieces))
            .collect();
        for (num, part) in parts.iter().enumerate() {
            let data = std::str::from_utf8(part).expect("ASCII");
            provider.send(
                &json!({"op": "fragment", "id": 1, "data": data, "num": num, "total": parts.len()}),
            );
        }
        if length < MAX_FRAME {
            assert_eq!(caller.receive()["values"], answer["values"]);
        } else {
            let status = failure(&mut caller, &json!(1));
            assert!(status.contains("the answer of /s"), "{status}");
        }
    }
}
