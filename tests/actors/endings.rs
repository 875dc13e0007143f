//! Calls and goals that end by thousands at one instant: everybody else has a turn meanwhile.
//!
//! **Invariant:** what still waits is told by the memory that is counted for it.

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Peer, WIDE};
use pendularm::actors::gateway::limits::{CALL_BYTES, MAX_WAITING_CALLS, MAX_WAITING_GOALS};
use serde_json::{Value, json};

const CLIENTS: usize = 8;

/// Each of eight clients sends `frame` as often as it may; then `end` ends all of that. When the first client hears of
/// the first end, most have not ended yet, and in the end everybody has heard of each once.
fn assert_ends_in_turns(
    each: usize,
    frame: impl Fn(usize) -> Value,
    end: impl AsyncFnOnce(Peer),
    is_end: impl Fn(&Value) -> bool,
) {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut provider = gateway.connect(WIDE);
        provider.provide("/s").await;
        provider
            .send(json!({"op": "advertise_action", "action": "/a", "type": "t/A"}))
            .await;
        provider.receive().await;
        let mut clients: Vec<Peer> = (0..CLIENTS).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            for n in 0..each {
                client.send(frame(n)).await;
            }
        }
        for _ in 0..CLIENTS * each {
            provider.receive().await;
        }
        let memory = gateway.gauges.memory();
        let all = memory.held();
        assert!(all > CLIENTS * each * CALL_BYTES, "{all}");
        end(provider).await;
        let first = clients[0].receive().await;
        let left = memory.held();
        assert!(left > all * 3 / 4, "{left} of {all} when one has heard");
        let mut first = Some(first);
        for client in &mut clients {
            for n in 0..each {
                let ended = match first.take() {
                    Some(first) => first,
                    None => client.receive().await,
                };
                assert!(is_end(&ended), "{ended}");
                assert_eq!(ended["id"], n, "each once, in order");
            }
        }
    });
}

fn call(n: usize) -> Value {
    json!({"op": "call_service", "service": "/s", "id": n, "timeout": 60})
}

fn failed(response: &Value, why: &str) -> bool {
    response["result"] == false && response["status"].as_str().unwrap().contains(why)
}

#[test]
fn calls_whose_provider_goes() {
    let gone = |response: &Value| failed(response, "gone");
    assert_ends_in_turns(
        MAX_WAITING_CALLS,
        call,
        async |provider| drop(provider),
        gone,
    );
}

#[test]
fn calls_whose_time_is_over() {
    let at_once = async |_: Peer| tokio::time::advance(Duration::from_secs(61)).await;
    let late = |response: &Value| failed(response, "timeout");
    assert_ends_in_turns(MAX_WAITING_CALLS, call, at_once, late);
}

#[test]
fn goals_whose_pursuer_goes() {
    let goal = |n| json!({"op": "send_action_goal", "action": "/a", "action_type": "t/A", "id": n, "args": {}});
    let aborted = |result: &Value| result["op"] == "action_result" && result["status"] == 6;
    assert_ends_in_turns(
        MAX_WAITING_GOALS,
        goal,
        async |provider| drop(provider),
        aborted,
    );
}
