//! The limits on what one connection may register, which docs/protocol.md lists.
//!
//! **Invariant:** what is over a limit is refused by name; what was registered before stays, and what is withdrawn makes
//! room again.

use crate::common::{Client, Runtime, provide};
use pendularm::actors::gateway::limits::{
    MAX_ADVERTISED, MAX_PROVIDED, MAX_SUBSCRIPTIONS, MAX_WAITING_CALLS,
};
use pendularm::protocol::limits::MAX_NAME;
use serde_json::{Value, json};

/// Sends `count` frames of an op on names of their own, and gives the statuses that come.
fn register(client: &mut Client, op: &str, field: &str, count: usize) -> Vec<Value> {
    let frames: String = (0..count)
        .map(|n| format!("{}\n", json!({"op": op, field: format!("/{n}"), "id": n})))
        .collect();
    client.send_bytes(frames.as_bytes());
    client.settle();
    let mut statuses = std::mem::take(&mut client.kept);
    statuses.retain(|frame| frame["op"] == "status");
    statuses
}

fn errors(statuses: &[Value]) -> Vec<&Value> {
    let errors = statuses.iter().filter(|status| status["level"] == "error");
    errors.map(|status| &status["id"]).collect()
}

#[test]
fn a_connection_holds_so_many_subscriptions() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let statuses = register(&mut client, "subscribe", "topic", MAX_SUBSCRIPTIONS + 1);
    assert_eq!(statuses.len(), MAX_SUBSCRIPTIONS + 1);
    assert_eq!(errors(&statuses), [MAX_SUBSCRIPTIONS]);
    // A topic that is subscribed already may be subscribed again, and a withdrawn one makes room.
    client.send(&json!({"op": "subscribe", "topic": "/5", "id": 5}));
    assert_eq!(client.status()["level"], "info");
    client.send(&json!({"op": "unsubscribe", "topic": "/5"}));
    client.send(&json!({"op": "subscribe", "topic": "/new"}));
    assert_eq!(client.status()["level"], "info");
    // The limit is each connection's own.
    runtime.connect().subscribe("/another");
}

#[test]
fn many_ids_of_one_topic_count_as_many_subscriptions() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let frames: String = (0..=MAX_SUBSCRIPTIONS)
        .map(|n| format!("{}\n", json!({"op": "subscribe", "topic": "/t", "id": n})))
        .collect();
    client.send_bytes(frames.as_bytes());
    client.settle();
    assert_eq!(errors(&client.kept), [MAX_SUBSCRIPTIONS]);
}

#[test]
fn a_connection_advertises_so_many_topics() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let statuses = register(&mut client, "advertise", "topic", MAX_ADVERTISED + 1);
    assert_eq!(errors(&statuses), [MAX_ADVERTISED]);
    client.send(&json!({"op": "unadvertise", "topic": "/5"}));
    client.send(&json!({"op": "advertise", "topic": "/new"}));
    client.send(&json!({"op": "advertise", "topic": "/6"}));
    client.settle();
    assert!(client.kept.is_empty(), "{:?}", client.kept);
}

#[test]
fn a_connection_provides_so_many_services() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let statuses = register(
        &mut client,
        "advertise_service",
        "service",
        MAX_PROVIDED + 1,
    );
    assert_eq!(errors(&statuses), [MAX_PROVIDED]);
    // A service that another connection takes over counts no more.
    let mut other = runtime.connect();
    provide(&mut other, "/5");
    client.send(&json!({"op": "advertise_service", "service": "/new"}));
    assert_eq!(client.status()["level"], "info");
}

#[test]
fn so_many_calls_of_a_connection_wait_for_other_clients() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    let frames: String = (0..=MAX_WAITING_CALLS)
        .map(|n| {
            format!(
                "{}\n",
                json!({"op": "call_service", "service": "/s", "id": n})
            )
        })
        .collect();
    caller.send_bytes(frames.as_bytes());
    let refused = caller.receive();
    assert_eq!(
        (&refused["id"], &refused["result"]),
        (&json!(MAX_WAITING_CALLS), &json!(false))
    );
    let call = provider.receive();
    provider.send(
        &json!({"op": "service_response", "service": "/s", "id": call["id"],
        "values": {}, "result": true}),
    );
    assert_eq!(caller.receive()["id"], 0);
    caller.send(&json!({"op": "call_service", "service": "/s", "id": "again"}));
    caller.settle();
    assert!(
        caller.kept.is_empty(),
        "there is room again: {:?}",
        caller.kept
    );
}

#[test]
fn a_name_has_so_many_bytes() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let name = |length: usize| format!("/{}", "x".repeat(length - 1));
    client.subscribe(&name(MAX_NAME));
    for (op, field) in [
        ("subscribe", "topic"),
        ("advertise", "topic"),
        ("publish", "topic"),
        ("advertise_service", "service"),
        ("call_service", "service"),
    ] {
        client.send(&json!({"op": op, field: name(MAX_NAME + 1), "msg": {}}));
        let status = client.receive();
        assert_eq!(status["level"], "error", "{op}: {status}");
        assert!(status["msg"].as_str().unwrap().contains(field), "{status}");
        assert!(
            status.to_string().len() < MAX_NAME,
            "the name is not repeated at length"
        );
    }
    client.send(&json!({"op": "subscribe", "topic": "/t", "id": name(MAX_NAME)}));
    let status = client.receive();
    assert_eq!(status["level"], "error", "quotes count: {}", status["msg"]);
}
