//! Thousands of calls and goals that end at one instant: other tasks still have turns. A caller that reads nothing.
//! `tests/wire/places.rs` has callers that have gone.
//!
//! **Invariant:** the share of other tasks is counted in their turns.

use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Client, Gateway, WIDE, turns_of_others};
use pendularm::actors::gateway::limits::STALL_LIMIT;
use pendularm::actors::gateway::registry::FinishAll;
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::time::{sleep, timeout};

const CLIENTS: usize = 16;
/// The number of calls or goals of each client.
const EACH: usize = 100;

/// Each client sends `frame` [`EACH`] times. Then `end` ends all of them. Other tasks have turns meanwhile, and in the
/// end each client has one notice per frame.
fn assert_ends_in_turns(
    frame: impl Fn(usize) -> Value,
    end: impl AsyncFnOnce(Client),
    is_end: impl Fn(&Value) -> bool,
) {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut provider = gateway.connect(WIDE);
        for advertise in [
            json!({"op": "advertise_service", "service": "/s"}),
            json!({"op": "advertise_action", "action": "/a", "type": "t/A"}),
        ] {
            provider.send(&advertise).await;
            provider.receive().await;
        }
        let mut clients: Vec<Client> = (0..CLIENTS).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            for n in 0..EACH {
                client.send(&frame(n)).await;
            }
        }
        for _ in 0..CLIENTS * EACH {
            provider.receive().await;
        }
        let (turns, ends) = turns_of_others(async {
            end(provider).await;
            let mut ends = Vec::new();
            for client in &mut clients {
                for _ in 0..EACH {
                    ends.push(client.receive().await);
                }
            }
            ends
        })
        .await;
        assert!(turns >= CLIENTS * EACH / 200, "{turns} turns");
        for ended in ends.chunks(EACH) {
            for (n, ended) in ended.iter().enumerate() {
                assert!(is_end(ended), "{ended}");
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
    assert_ends_in_turns(call, async |provider| drop(provider), gone);
}

#[test]
fn calls_whose_time_is_over() {
    let at_once = async |_: Client| tokio::time::advance(Duration::from_secs(61)).await;
    let late = |response: &Value| failed(response, "timeout");
    assert_ends_in_turns(call, at_once, late);
}

#[test]
fn goals_of_a_disconnected_action_server() {
    let goal = |n| json!({"op": "send_action_goal", "action": "/a", "action_type": "t/A", "id": n, "args": {}});
    let aborted = |result: &Value| result["op"] == "action_result" && result["status"] == 6;
    assert_ends_in_turns(goal, async |provider| drop(provider), aborted);
}

/// The answers would wait in memory.
#[test]
fn a_client_that_reads_nothing_is_not_read_when_the_runtime_ends() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(8 * 1024);
        let calls = format!("{}\n", call(1)).repeat(10_000);
        for is_ending in [false, true] {
            if is_ending {
                gateway.registry.send(FinishAll).await.unwrap();
            }
            let all = client.stream().write_all(calls.as_bytes());
            let sent = timeout(Duration::from_secs(1), all).await;
            assert!(sent.is_err(), "{is_ending}: all of it was read");
        }
        sleep(STALL_LIMIT).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}
