//! A provider that never reads costs its callers a refusal, and the program a bounded amount of memory.
//!
//! **Invariant:** nothing here is timed: refusals are counted, and memory is the program's peak.

use crate::common::{Runtime, provide};
use pendularm::actors::gateway::limits::MAX_BACKLOG;
use serde_json::json;

const MIB: usize = 1024 * 1024;
/// Memory of the program itself, with the additions of an allocator and a test build.
const BASE: usize = 40 * MIB;

#[test]
fn calls_of_a_provider_that_never_reads_are_refused_and_use_bounded_memory() {
    let runtime = Runtime::start();
    let mut provider = runtime.connect();
    provide(&mut provider, "/s");
    let mut caller = runtime.connect();
    let blob = "x".repeat(50_000);
    let mut busy = 0;
    for id in 0..200 {
        caller.send(
            &json!({"op": "call_service", "service": "/s", "id": id, "timeout": 1e-3,
            "args": {"blob": blob}}),
        );
        let response = caller.receive();
        assert_eq!(
            (&response["id"], &response["result"]),
            (&json!(id), &json!(false))
        );
        busy += usize::from(
            response["status"]
                .as_str()
                .unwrap()
                .contains("does not read"),
        );
    }
    assert!(busy > 50, "{busy} of 200 refused");
    let peak = runtime.peak_memory();
    assert!(peak < BASE + MAX_BACKLOG + 16 * MIB, "{peak} bytes");
}

/// The same as for calls and goals: repeated cancellations neither fill the memory nor end another client's connection.
#[test]
fn cancellations_for_a_client_that_never_reads_are_refused_when_too_many_wait() {
    let runtime = Runtime::start();
    let action = format!("/{}", "dance".repeat(40));
    let mut pursuer = runtime.connect();
    pursuer.send(&json!({"op": "advertise_action", "action": action, "type": "demo/Dance"}));
    pursuer.status();
    let mut client = runtime.connect();
    client.send(&json!({"op": "send_action_goal", "id": "g", "action": action, "args": {}}));
    let cancel = json!({"op": "cancel_action_goal", "id": "g", "action": action});
    let mut refused = 0;
    for _ in 0..60 {
        for _ in 0..5_000 {
            client.send(&cancel);
        }
        client.send(&json!({"op": "call_service", "id": "end", "service": "/arm_sim/pause"}));
        while let frame = client.receive()
            && frame["id"] != "end"
        {
            refused += usize::from(frame["msg"].as_str().unwrap().contains("does not read"));
        }
        if refused > 0 {
            break;
        }
    }
    assert!(refused > 0, "all went on");
    let peak = runtime.peak_memory();
    assert!(peak < BASE + MAX_BACKLOG + 32 * MIB, "{peak} bytes");
}
