//! The order of frames where the arm and the gateway run on threads of their own.
//!
//! **Invariant:** a possible race has hundreds of chances.

use crate::arm::{stamp, state_where};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

fn call(service: &str, id: impl Into<Value>, args: Value) -> String {
    let frame = json!({"op": "call_service", "service": service, "id": id.into(), "args": args});
    format!("{frame}\n")
}

/// The first `/joint_states` after the response to this call.
fn states_after<const N: usize>(client: &mut Client, service: &str, args: Value) -> [Value; N] {
    client.send_bytes(call(service, "call", args).as_bytes());
    client.receive_where("response", |frame| frame["id"] == "call");
    client.kept.clear();
    std::array::from_fn(|_| client.message("/joint_states"))
}

#[test]
fn no_state_from_before_follows_the_response_to_a_pause() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    for _ in 0..15 {
        client.message("/joint_states");
        let [first, second] = states_after(&mut client, "/arm_sim/pause", json!({"data": true}));
        assert_eq!(
            first, second,
            "the arm moved after the response to the pause"
        );
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}

#[test]
fn no_state_from_before_follows_the_response_to_a_reset() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    for round in 0..30 {
        // A late arm catches up at most 250 ms, so a time of half a second is from before the reset.
        let (paused, least) = if round % 2 == 0 {
            (true, 0.1)
        } else {
            (false, 0.5)
        };
        state_where(&mut client, "a moving arm", |state| stamp(state) > least);
        client.send_bytes(call("/arm_sim/pause", "pause", json!({"data": paused})).as_bytes());
        let [after] = states_after(&mut client, "/arm_sim/reset", json!({}));
        let after = stamp(&after);
        assert!(
            after == 0.0 || !paused && after < least,
            "round {round}: {after} s"
        );
        client.ask("/arm_sim/pause", json!({"data": false}));
    }
}
