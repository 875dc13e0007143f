//! What one connection may register, as docs/protocol.md lists it.
//!
//! **Invariant:** a registration over a limit is refused by name; earlier ones stay, and a withdrawn one makes room again.

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Peer, WIDE};
use pendularm::actors::gateway::limits::{ENTRY_BYTES, MAX_KEPT};
use serde_json::{Value, json};

/// Registrations that fit, each with names of this many bytes.
const fn most(bytes: usize) -> usize {
    MAX_KEPT / (ENTRY_BYTES + 3 * bytes)
}

/// The levels of the statuses that answer these frames.
async fn levels(client: &mut Peer, frames: impl IntoIterator<Item = Value>) -> Vec<Value> {
    for frame in frames {
        client.send(frame).await;
    }
    client
        .send(json!({"op": "call_service", "service": "/none", "id": "end"}))
        .await;
    let mut levels = Vec::new();
    loop {
        let mut frame = client.receive().await;
        if frame["id"] == "end" {
            return levels;
        }
        levels.push(frame["level"].take());
    }
}

#[test]
fn a_connection_registers_so_much_and_no_more() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        for (op, field, withdraw) in [
            ("subscribe", "topic", "unsubscribe"),
            ("advertise", "topic", "unadvertise"),
            ("advertise_service", "service", "unadvertise_service"),
            ("advertise_action", "action", "unadvertise_action"),
        ] {
            // A name has five bytes. The `id` of a subscription is kept too, with its quotes.
            let fitting = if op == "subscribe" { most(12) } else { most(5) };
            let register = |n: usize| {
                let name = format!("/{n:04}");
                json!({"op": op, field: name, "id": name, "type": ""})
            };
            let mut client = gateway.connect(WIDE);
            let told = levels(&mut client, (0..=fitting).map(register)).await;
            let errors = told.iter().filter(|level| **level == "error").count();
            assert_eq!((errors, told.last()), (1, Some(&json!("error"))), "{op}");
            // What is registered already may be registered again, and what is withdrawn makes room.
            let freed = json!({"op": withdraw, field: "/0000"});
            let frames = [register(0), register(1), freed, register(fitting)];
            let told = levels(&mut client, frames).await;
            assert!(!told.contains(&json!("error")), "{op}: {told:?}");
            // The limit is each connection's own.
            assert!(
                !levels(&mut gateway.connect(WIDE), [register(0)])
                    .await
                    .contains(&json!("error"))
            );
        }
    });
}

#[test]
fn a_service_that_another_client_takes_over_makes_room() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut client, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        let provide = |n: usize| json!({"op": "advertise_service", "service": format!("/{n:04}")});
        levels(&mut client, (0..most(5)).map(provide)).await;
        assert_eq!(levels(&mut client, [provide(9999)]).await, ["error"]);
        assert_eq!(levels(&mut other, [provide(5)]).await, ["info"]);
        assert_eq!(levels(&mut client, [provide(9999)]).await, ["info"]);
    });
}

#[test]
fn so_many_calls_and_goals_of_a_connection_wait_for_other_clients() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut provider = gateway.connect(WIDE);
        provider.provide("/s").await;
        provider
            .send(json!({"op": "advertise_action", "action": "/a", "type": "t/A"}))
            .await;
        provider.receive().await;
        for (op, field, name, why) in [
            ("call_service", "service", "/s", "status"),
            ("send_action_goal", "action", "/a", "values"),
        ] {
            let mut caller = gateway.connect(WIDE);
            let id = "x".repeat(1000);
            for _ in 0..=most(id.len()) {
                caller
                    .send(json!({"op": op, field: name, "id": id, "args": {}}))
                    .await;
            }
            caller
                .send(json!({"op": "call_service", "service": "/none", "id": "end"}))
                .await;
            let mut refused = Vec::new();
            loop {
                let frame = caller.receive().await;
                if frame["id"] == "end" {
                    break;
                }
                // A goal is refused by a status first.
                refused.extend(
                    frame[why]
                        .as_str()
                        .filter(|_| frame["result"] == false)
                        .map(str::to_owned),
                );
            }
            // The `id` is kept too.
            assert!(
                (1..=1 + most(id.len()) / 10).contains(&refused.len()),
                "{op}: {refused:?}"
            );
            assert!(refused[0].contains("keeps too much"), "{refused:?}");
        }
    });
}
