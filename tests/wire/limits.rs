//! The limits on what one connection may register, which docs/protocol.md lists.
//!
//! **Invariant:** what is over a limit is refused by name; what was registered before stays, and what is withdrawn makes
//! room again.

use crate::common::{Runtime, provide};
use pendularm::actors::gateway::limits::{ENTRY_BYTES, MAX_KEPT};
use pendularm::protocol::limits::MAX_NAME;
use serde_json::{Value, json};

fn errors(statuses: &[Value]) -> Vec<&Value> {
    let errors = statuses.iter().filter(|status| status["level"] == "error");
    errors.map(|status| &status["id"]).collect()
}

/// Frames of each kind, as many as a connection may have and one more.
#[test]
fn a_connection_registers_so_much_and_no_more() {
    let runtime = Runtime::start();
    let most = |names: usize| MAX_KEPT / (ENTRY_BYTES + 3 * names);
    // Each name is five characters long.
    for (op, field, withdraw) in [
        ("subscribe", "topic", "unsubscribe"),
        ("advertise", "topic", "unadvertise"),
        ("advertise_service", "service", "unadvertise_service"),
        ("advertise_action", "action", "unadvertise_action"),
    ] {
        let names: Vec<String> = (0..=most(5)).map(|n| format!("/{n:04}")).collect();
        let mut client = runtime.connect();
        let frames: String = names
            .iter()
            .map(|name| {
                format!(
                    "{}\n",
                    json!({"op": op, field: name, "id": name, "type": ""})
                )
            })
            .collect();
        client.send_bytes(frames.as_bytes());
        client.settle();
        let statuses = std::mem::take(&mut client.kept);
        let refused = errors(&statuses);
        if op == "subscribe" {
            // Its `id` is one of its names.
            assert_eq!(refused.len(), most(5) + 1 - most(12), "{op}");
        } else {
            assert_eq!(refused, [&names[most(5)]], "{op}");
        }
        // What is registered already may be registered again, and what is withdrawn makes room.
        for name in [&names[0], &names[1]] {
            client.send(&json!({"op": op, field: name, "id": name, "type": ""}));
        }
        client.send(&json!({"op": withdraw, field: names[0]}));
        client.send(&json!({"op": op, field: "/last", "id": "/last", "type": ""}));
        client.settle();
        assert!(errors(&client.kept).is_empty(), "{op}: {:?}", client.kept);
    }
    // The limit is each connection's own.
    runtime.connect().subscribe("/another");
}

#[test]
fn a_service_that_another_client_takes_over_makes_room() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let most = MAX_KEPT / (ENTRY_BYTES + 3 * 5);
    let frames: String = (0..most)
        .map(|n| {
            format!(
                "{}\n",
                json!({"op": "advertise_service", "service": format!("/{n:04}")})
            )
        })
        .collect();
    client.send_bytes(frames.as_bytes());
    client.settle();
    client.kept.clear();
    client.send(&json!({"op": "advertise_service", "service": "/last"}));
    assert_eq!(client.status()["level"], "error");
    let mut other = runtime.connect();
    provide(&mut other, "/0005");
    client.send(&json!({"op": "advertise_service", "service": "/last"}));
    assert_eq!(client.status()["level"], "info");
}

/// The `id` of each is kept too.
#[test]
fn so_many_calls_and_goals_of_a_connection_wait_for_other_clients() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    provider.send(&json!({"op": "advertise_action", "action": "/a", "type": "t/A"}));
    provider.status();
    for (op, field, name, end) in [
        ("call_service", "service", "/s", "service_response"),
        ("send_action_goal", "action", "/a", "action_result"),
    ] {
        let id = "x".repeat(1000);
        let mut forwarded = 0;
        let refused = loop {
            caller.send(&json!({"op": op, field: name, "id": id, "args": {}}));
            caller.send(&json!({"op": "call_service", "service": "/nobody", "id": "n"}));
            let mut answer = caller.receive();
            // A goal is refused by a status first.
            if answer["op"] == "status" {
                answer = caller.receive();
            }
            if answer["id"] != "n" {
                caller.receive();
                break answer;
            }
            forwarded += 1;
        };
        assert_eq!(
            (&refused["op"], &refused["result"]),
            (&json!(end), &json!(false))
        );
        let why = if op == "call_service" {
            &refused["status"]
        } else {
            &refused["values"]
        };
        assert!(why.as_str().unwrap().contains("keeps too much"), "{why}");
        let most = MAX_KEPT / (ENTRY_BYTES + 3 * id.len());
        assert!((most * 9 / 10..=most).contains(&forwarded), "{forwarded}");
        caller = runtime.connect();
    }
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
