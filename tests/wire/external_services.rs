//! Services that clients provide.
//!
//! **Invariant:** a call is answered once, by its provider or with the reason why not, and under its caller's own id.

use crate::common::{Client, Runtime, forwarded, provide, respond};
use serde_json::{Value, json};

pub fn call(client: &mut Client, service: &str, id: Value) {
    client.send(&json!({"op": "call_service", "service": service, "id": id, "args": {"a": 1}}));
}

/// The next response, which must be a failure; gives its status.
pub fn failure(client: &mut Client, id: &Value) -> String {
    let response = client.receive_where("response", |frame| frame["op"] == "service_response");
    assert_eq!(&response["id"], id, "{response}");
    assert_eq!(response["result"], false, "{response}");
    assert_eq!(response["values"], json!({}), "{response}");
    response["status"].as_str().expect("a text").to_owned()
}

#[test]
fn a_call_goes_to_its_provider_and_the_answer_back() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    call(&mut caller, "/s", json!("mine"));
    let frame = forwarded(&mut provider);
    assert_eq!(frame["service"], "/s");
    assert_eq!(frame["args"], json!({"a": 1}));
    assert_ne!(frame["id"], "mine", "the id is the runtime's own");
    respond(&mut provider, &frame, json!({"b": 2}));
    assert_eq!(
        caller.receive(),
        json!({"op": "service_response", "service": "/s", "id": "mine", "values": {"b": 2},
            "result": true, "status": ""})
    );
}

#[test]
fn a_providers_refusal_reaches_the_caller_with_its_status() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    call(&mut caller, "/s", json!(1));
    let frame = forwarded(&mut provider);
    provider.send(
        &json!({"op": "service_response", "service": "/s", "id": frame["id"],
        "values": {}, "result": false, "status": "out of paint"}),
    );
    assert_eq!(failure(&mut caller, &json!(1)), "out of paint");
}

#[test]
fn calls_of_several_clients_under_the_same_id_do_not_mix() {
    let runtime = Runtime::start();
    let mut provider = runtime.connect();
    provide(&mut provider, "/s");
    let mut callers: Vec<Client> = (0..5).map(|_| runtime.connect()).collect();
    let mut frames = Vec::new();
    for caller in &mut callers {
        call(caller, "/s", json!(1));
        frames.push(forwarded(&mut provider));
    }
    for (index, frame) in frames.iter().enumerate().rev() {
        respond(&mut provider, frame, json!({"index": index}));
    }
    for (index, caller) in callers.iter_mut().enumerate() {
        assert_eq!(caller.receive()["values"]["index"], index);
    }
}

#[test]
fn the_newest_provider_wins_and_calls_under_way_stay_with_theirs() {
    let runtime = Runtime::start();
    let (mut old, mut new, mut caller) = (runtime.connect(), runtime.connect(), runtime.connect());
    provide(&mut old, "/s");
    call(&mut caller, "/s", json!("old"));
    let under_way = forwarded(&mut old);
    provide(&mut new, "/s");
    call(&mut caller, "/s", json!("new"));
    let frame = forwarded(&mut new);
    respond(&mut new, &frame, json!({"from": "new"}));
    assert_eq!(caller.receive()["values"]["from"], "new");
    respond(&mut old, &under_way, json!({"from": "old"}));
    assert_eq!(caller.receive()["values"]["from"], "old");
    // A service that is no longer its own it can't withdraw, and its end takes nothing along.
    old.send(&json!({"op": "unadvertise_service", "service": "/s", "id": 5}));
    let status = old.status();
    assert_eq!(
        (&status["level"], &status["id"]),
        (&json!("error"), &json!(5))
    );
    drop(old);
    call(&mut caller, "/s", json!("newer"));
    forwarded(&mut new);
}

#[test]
fn advertising_a_service_twice_is_advertising_it_once() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    provide(&mut provider, "/s");
    provider.send(&json!({"op": "unadvertise_service", "service": "/s"}));
    provider.settle();
    call(&mut caller, "/s", json!(1));
    assert!(failure(&mut caller, &json!(1)).contains("provider"));
}

#[test]
fn a_withdrawn_service_has_no_provider_but_calls_under_way_are_answered() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    call(&mut caller, "/s", json!(1));
    let frame = forwarded(&mut provider);
    provider.send(&json!({"op": "unadvertise_service", "service": "/s"}));
    provider.settle();
    call(&mut caller, "/s", json!(2));
    let status = failure(&mut caller, &json!(2));
    assert!(
        status.contains("no provider") && status.contains("/s"),
        "{status}"
    );
    respond(&mut provider, &frame, json!({}));
    assert_eq!(caller.receive()["id"], 1);
}

#[test]
fn only_the_current_provider_may_withdraw_a_service() {
    let runtime = Runtime::start();
    let (mut provider, mut other) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    for service in ["/s", "/none", "/arm_sim/pause"] {
        other.send(&json!({"op": "unadvertise_service", "service": service}));
        let status = other.status();
        assert_eq!(status["level"], "error", "{status}");
        assert!(
            status["msg"].as_str().unwrap().contains(service),
            "{status}"
        );
    }
    call(&mut other, "/s", json!(1));
    forwarded(&mut provider);
}

#[test]
fn a_service_of_the_runtime_itself_cannot_be_taken_over() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in pendularm::protocol::catalog::Service::ALL {
        client.send(&json!({"op": "advertise_service", "service": service.name(), "id": 1}));
        let status = client.status();
        assert_eq!(status["level"], "error", "{status}");
        assert!(
            status["msg"].as_str().unwrap().contains(service.name()),
            "{status}"
        );
    }
    client.settle();
}

#[test]
fn an_answer_with_an_unknown_or_stale_id_is_an_error_and_completes_nobodys_call() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    let mut other = runtime.connect();
    provide(&mut provider, "/s");
    provide(&mut other, "/other");
    call(&mut caller, "/s", json!(1));
    let frame = forwarded(&mut provider);
    let refused = |client: &mut Client, service: &str, id: &Value| {
        client.send(
            &json!({"op": "service_response", "service": service, "id": id,
            "values": {"forged": true}, "result": true}),
        );
        let status = client.status();
        assert_eq!(status["level"], "error", "{status}");
        assert_eq!(&status["id"], id, "{status}");
    };
    // Not this connection's call, not this service's, and no call at all; the caller's own id is not the runtime's.
    refused(&mut other, "/s", &frame["id"]);
    refused(&mut other, "/other", &frame["id"]);
    refused(&mut caller, "/s", &frame["id"]);
    for id in [
        json!(1),
        json!(null),
        json!("1"),
        json!("pendularm:"),
        json!("pendularm:999"),
        json!({}),
    ] {
        refused(&mut provider, "/s", &id);
    }
    respond(&mut provider, &frame, json!({"genuine": true}));
    assert_eq!(caller.receive()["values"], json!({"genuine": true}));
    refused(&mut provider, "/s", &frame["id"]);
    caller.settle();
    assert!(caller.kept.is_empty(), "{:?}", caller.kept);
}

#[test]
fn a_client_may_call_a_service_that_it_provides_itself() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    provide(&mut client, "/s");
    call(&mut client, "/s", json!(1));
    let frame = forwarded(&mut client);
    respond(&mut client, &frame, json!({"b": 2}));
    assert_eq!(client.receive()["values"], json!({"b": 2}));
}

#[test]
fn a_call_that_waits_holds_up_nothing_else_of_its_caller() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    call(&mut caller, "/s", json!(1));
    caller.settle();
    call(&mut caller, "/s", json!(2));
    let (first, second) = (forwarded(&mut provider), forwarded(&mut provider));
    respond(&mut provider, &second, json!({}));
    assert_eq!(caller.receive()["id"], 2);
    respond(&mut provider, &first, json!({}));
    assert_eq!(caller.receive()["id"], 1);
}

#[test]
fn arguments_reach_a_provider_as_an_object_or_as_the_array_that_was_sent() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    for (sent, arrives) in [
        ("", json!({})),
        (",\"args\":null", json!({})),
        (",\"args\":{\"a\":[1]}", json!({"a": [1]})),
        (",\"args\":[1,\"b\"]", json!([1, "b"])),
    ] {
        caller.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"/s\"{sent}}}\n").as_bytes(),
        );
        assert_eq!(forwarded(&mut provider)["args"], arrives);
    }
    caller.send(&json!({"op": "call_service", "service": "/s", "args": 7, "id": 9}));
    assert!(failure(&mut caller, &json!(9)).contains("args"));
    provider.settle();
    assert!(provider.kept.is_empty(), "{:?}", provider.kept);
}
