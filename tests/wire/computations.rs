//! Computations beside the arm, beside light requests, and beside those of other connections.

use std::time::Duration;

use crate::arm::{in_one_of_three_tries, stamp, state};
use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const SERVICE: &str = "/arm_sim/integration_step";

/// A good request with one field replaced.
fn with(field: &str, value: Value) -> Value {
    let mut request = json!({"function": "t", "x0": 0.0, "xdot0": 0.0, "dt": 0.1, "steps": 10, "integrator": "rk4"});
    request[field] = value;
    request
}

fn response(client: &mut Client) -> Value {
    client.receive_where("response", |frame| frame["op"] == "service_response")
}

/// A request of seconds of work and a small answer: a sum of 2001 terms (4001 nodes), 4 times in each of 100,000 steps.
/// A test that sends it does not wait for its end.
fn heavy() -> Value {
    let sum = vec!["t"; 2001].join("+");
    json!({"function": sum, "x0": 0, "dt": 1e-3, "steps": 100_000, "integrator": "rk4"})
}

/// The same for some hundred milliseconds.
fn lighter() -> Value {
    let mut request = heavy();
    request["steps"] = json!(10_000);
    request
}

/// A call, as a line.
fn call(id: &str, args: &Value) -> String {
    let frame = json!({"op": "call_service", "service": SERVICE, "id": id, "args": args});
    format!("{frame}\n")
}

/// A call that is answered at once, as a line.
const LIGHT: &str =
    "{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"id\":\"light\"}\n";

fn send_call(client: &mut Client, id: &str, args: &Value) {
    client.send_bytes(call(id, args).as_bytes());
}

#[test]
fn the_live_arm_neither_helps_nor_hears_of_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    let settings = |client: &mut Client| {
        [
            "/arm_sim/set_integrator",
            "/arm_sim/set_params",
            "/arm_sim/pause",
            "/pid_controller/enable",
            "/pid_controller/set_gains",
        ]
        .map(|service| client.ask(service, json!({})))
    };
    let (before, settings_before) = (state(&mut client), settings(&mut client));
    let paused = client.ask(SERVICE, with("integrator", json!("euler")));
    assert_eq!(
        (before, settings_before),
        (state(&mut client), settings(&mut client))
    );

    client.ask(
        "/arm_sim/set_params",
        json!({"gravity": 3, "lengths": [2, 2]}),
    );
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "verlet", "timestep": 0.01}),
    );
    client.ask("/arm_sim/pause", json!({"data": false}));
    assert_eq!(
        client.ask(SERVICE, with("integrator", json!("euler"))),
        paused
    );
}

#[test]
fn light_requests_overtake_a_heavy_one_on_the_same_connection() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes((call("heavy", &lighter()) + LIGHT).as_bytes());
    assert_eq!(response(&mut client)["id"], "light");
    assert_eq!(response(&mut client)["id"], "heavy");
}

#[test]
fn the_computations_of_a_connection_are_done_one_after_another_and_none_is_refused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // The first is the longest: were two done at a time, the second would be answered before it.
    send_call(&mut client, "0", &lighter());
    for id in 1..60 {
        send_call(&mut client, &id.to_string(), &with("x0", json!(id)));
    }
    for id in 0..60 {
        let response = response(&mut client);
        assert_eq!(response["id"], id.to_string());
        assert_eq!(response["result"], true);
    }
}

#[test]
fn a_connection_with_sixteen_computations_waiting_is_not_read() {
    let runtime = Runtime::start();
    for (computations, overtaken) in [(17, false), (16, true)] {
        let mut client = runtime.connect();
        let later = call("later", &heavy()).repeat(computations - 1);
        // At once, so that all have come before the first is done.
        client.send_bytes((call("first", &lighter()) + &later + LIGHT).as_bytes());
        // One runs. Behind it 16 may wait before the connection is no longer read, until the first is done.
        let first = response(&mut client);
        assert_eq!(first["id"], if overtaken { "light" } else { "first" });
        let second = response(&mut client);
        assert_eq!(second["id"], if overtaken { "first" } else { "light" });
    }
}

#[test]
fn connections_take_turns() {
    let runtime = Runtime::start();
    let mut patient = runtime.connect();
    send_call(&mut patient, "heavy", &heavy());
    patient.settle();
    // Order is what is asserted, not time: ten small requests of another client are done before the large one.
    let mut other = runtime.connect();
    for _ in 0..10 {
        other.ask(SERVICE, with("integrator", json!("verlet")));
    }
    let early = patient.receive_for(Duration::from_millis(1));
    assert!(
        early.is_empty(),
        "the heavy request was done first: make it heavier"
    );
}

#[test]
fn the_arm_and_its_messages_go_on_while_somebody_computes() {
    in_one_of_three_tries("a third of the time and a sixth of the messages", || {
        let runtime = Runtime::start();
        let mut busy: Vec<Client> = (0..3).map(|_| runtime.connect()).collect();
        for client in &mut busy {
            send_call(client, "heavy", &heavy());
            client.settle();
        }
        let mut watcher = runtime.connect();
        watcher.subscribe("/joint_states");
        let seen = watcher.receive_for(Duration::from_secs(2));
        let stamps: Vec<f64> = seen.iter().map(|frame| stamp(&frame["msg"])).collect();
        // 120 and 2 s on an idle machine.
        let simulated = stamps.last().unwrap_or(&0.0) - stamps.first().unwrap_or(&0.0);
        (stamps.len() > 20 && simulated > 0.7)
            .then_some(())
            .ok_or(format!("{} and {simulated} s in 2 s", stamps.len()))
    });
}

#[test]
fn a_client_that_leaves_takes_its_computations_along() {
    let runtime = Runtime::start();
    let mut gone = runtime.connect();
    for _ in 0..17 {
        send_call(&mut gone, "heavy", &heavy());
    }
    drop(gone);
    // Were they finished first, this would wait for a minute or so.
    let mut client = runtime.connect();
    client.ask(SERVICE, lighter());
}
