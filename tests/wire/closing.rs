//! The end of a connection: its registrations, its last answers, and the state that outlives it.
//!
//! **Invariant:** a client that has only stopped sending gets every answer that it is owed.

use std::time::Instant;

use crate::common::{Client, PATIENCE, Runtime};
use crate::diagnostics::gateway_count;
use serde_json::{Value, json};

#[test]
fn a_half_closed_client_gets_the_results_of_its_computations_and_then_the_end() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for id in 0..25 {
        client.send(&json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
            "args": {"function": "sin(t)", "x0": 0, "dt": 0.1, "steps": 20_000, "integrator": "rk4"}}));
    }
    client.finish();
    let mut ids: Vec<u64> = (0..25)
        .map(|_| client.receive()["id"].as_u64().unwrap())
        .collect();
    ids.sort_unstable();
    assert_eq!(ids, (0..25).collect::<Vec<_>>());
    assert!(client.is_closed());
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
