//! The end of a connection: its registrations, its last answers, and the state that outlives it.
//!
//! **Invariant:** a client that has only stopped sending gets every answer that it is owed.

use std::net::Shutdown;
use std::time::{Duration, Instant};

use crate::common::{Client, PATIENCE, Runtime, provide};
use crate::diagnostics::gateway_count;
use serde_json::{Value, json};

fn half_close(client: &Client) {
    client
        .stream()
        .shutdown(Shutdown::Write)
        .expect("the stream is open");
}

/// All frames up to the end of the stream.
fn rest(client: &mut Client) -> Vec<Value> {
    let mut frames = Vec::new();
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut client.stream(), &mut bytes).expect("an orderly end");
    for line in bytes
        .split(|&byte| byte == b'\n')
        .filter(|line| !line.is_empty())
    {
        frames.push(serde_json::from_slice(line).expect("a frame"));
    }
    frames
}

fn ids(frames: &[Value]) -> Vec<u64> {
    let mut ids: Vec<u64> = frames
        .iter()
        .filter_map(|frame| frame["id"].as_u64())
        .collect();
    ids.sort_unstable();
    ids
}

#[test]
fn a_half_closed_client_gets_the_results_of_its_computations() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for id in 0..25 {
        client.send(&json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
            "args": {"function": "sin(t)", "x0": 0, "dt": 0.1, "steps": 20_000, "integrator": "rk4"}}));
    }
    half_close(&client);
    let frames = rest(&mut client);
    assert_eq!(ids(&frames), (0..25).collect::<Vec<_>>());
    assert!(frames.iter().all(|frame| frame["result"] == true));
}

#[test]
fn a_half_closed_client_with_nothing_to_come_is_closed_at_once() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.message("/joint_states");
    let began = Instant::now();
    half_close(&client);
    rest(&mut client);
    assert!(
        began.elapsed() < Duration::from_secs(4),
        "it may linger, but not for this"
    );
}

#[test]
fn what_a_half_closed_client_provides_is_withdrawn_and_its_own_calls_fail_if_nobody_else_can_answer()
 {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    provider.send(&json!({"op": "call_service", "service": "/s", "id": 7}));
    caller.send(&json!({"op": "call_service", "service": "/s", "id": 8}));
    caller.settle();
    half_close(&provider);
    for (client, id) in [(&mut provider, 7), (&mut caller, 8)] {
        let response = client.receive_where("response", |frame| frame["op"] == "service_response");
        assert_eq!(
            (&response["id"], &response["result"]),
            (&json!(id), &json!(false))
        );
        assert!(
            response["status"].as_str().unwrap().contains("gone"),
            "{response}"
        );
    }
    assert!(provider.is_closed());
}

#[test]
fn a_closed_connection_is_counted_no_more_and_leaves_its_settings_behind() {
    let runtime = Runtime::start();
    let mut watcher = runtime.connect();
    watcher.subscribe("/diagnostics");
    let mut clients: Vec<Client> = (0..9).map(|_| runtime.connect()).collect();
    for client in &mut clients {
        client.subscribe("/joint_states");
        client.ask("/arm_sim/set_params", json!({"gravity": 3}));
        client.ask("/pid_controller/enable", json!({"data": true}));
    }
    let deadline = Instant::now() + PATIENCE;
    while gateway_count(&mut watcher, "connections") != 10 {
        assert!(Instant::now() < deadline);
    }
    drop(clients);
    while gateway_count(&mut watcher, "connections") != 1 {
        assert!(Instant::now() < deadline);
    }
    assert_eq!(
        watcher.ask("/arm_sim/set_params", json!({}))["gravity"],
        3.0
    );
    assert_eq!(
        watcher.ask("/pid_controller/enable", json!({}))["data"],
        true
    );
}

#[test]
fn fifty_clients_at_once_drive_and_watch_the_arm() {
    let runtime = Runtime::start();
    let mut clients: Vec<Client> = (0..50).map(|_| runtime.connect()).collect();
    for client in &mut clients {
        client.subscribe("/joint_states");
        client.subscribe("/joint_trajectory");
    }
    for (number, client) in clients.iter_mut().enumerate() {
        client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
            "msg": {"points": [{"positions": [number, 0]}]}}));
        client.send(&json!({"op": "call_service", "service": "/arm_sim/set_params", "id": number}));
    }
    for (number, client) in clients.iter_mut().enumerate() {
        client.receive_where("response", |frame| frame["id"] == number);
        // Every trajectory reaches everybody once, in one order.
        while client
            .kept
            .iter()
            .filter(|frame| frame["topic"] == "/joint_trajectory")
            .count()
            < 50
        {
            let frame = client.receive();
            client.kept.push(frame);
        }
    }
    let order = |client: &Client| -> Vec<Value> {
        let messages = client
            .kept
            .iter()
            .filter(|frame| frame["topic"] == "/joint_trajectory");
        messages
            .map(|frame| frame["msg"]["points"][0]["positions"][0].clone())
            .collect()
    };
    for client in &clients {
        assert_eq!(order(client), order(&clients[0]));
    }
    for client in &mut clients {
        client.message("/joint_states");
    }
}
