//! The end of the program during all kinds of work.
//!
//! **Invariant:** each client gets its answers or an error; other clients are not affected.

use std::io::Write;
use std::time::Duration;

use crate::arm::ticks;
use crate::common::{Client, Runtime, provide, signal};
use serde_json::json;

const STEP: &str = "/arm_sim/integration_step";
/// Minutes of work in a test build: to a client that waits, a pool that is stuck.
const ENDLESS: &str = "sin(sin(sin(sin(sin(sin(t))))))^2+cos(cos(cos(cos(t))))^3";

fn ask_steps(client: &mut Client, function: &str, steps: u64, id: usize) {
    client.send(&json!({"op": "call_service", "service": STEP, "id": id,
        "args": {"function": function, "x0": 1.0 / 3.0, "dt": 1e-3, "steps": steps,
            "integrator": "rk4"}}));
}

/// Calls whose answers nobody reads, until the end.
fn flood(client: &Client) -> std::thread::JoinHandle<()> {
    let stream = client.stream().try_clone().unwrap();
    std::thread::spawn(move || {
        let frames = b"{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\"}\n".repeat(100);
        while (&stream).write_all(&frames).is_ok() {}
    })
}

/// Watchers, a deaf subscriber, a flood, computations, a provider that never answers, and a client that begins to read only after
/// the signal: all of it ends in time, and that client has every byte that it was owed.
#[test]
fn sigterm_under_load_ends_in_time_and_flushes_what_is_read() {
    let mut runtime = Runtime::start();
    let mut watchers: Vec<Client> = (0..100).map(|_| runtime.connect()).collect();
    for client in &mut watchers {
        client.subscribe("/joint_states");
        client.subscribe("/tf");
    }
    let mut deaf = runtime.connect();
    deaf.subscribe("/big");
    let mut computing: Vec<Client> = (0..5).map(|_| runtime.connect()).collect();
    for client in &mut computing {
        ask_steps(client, ENDLESS, 1_000_000, 7);
    }
    let mut provider = runtime.connect();
    provide(&mut provider, "/s");
    let mut late = runtime.connect();
    late.subscribe("/big");
    late.send(&json!({"op": "advertise", "topic": "/big"}));
    let blob = "x".repeat(10_000);
    for n in 0..30 {
        late.send(&json!({"op": "publish", "topic": "/big", "msg": {"n": n, "blob": blob}}));
    }
    late.send(&json!({"op": "call_service", "service": "/s", "id": "pending"}));
    provider.receive();
    let flooding = flood(&runtime.connect());
    let reading = std::thread::spawn(move || {
        let mut frames = Vec::new();
        while frames
            .last()
            .is_none_or(|frame: &serde_json::Value| frame["id"] != "pending")
        {
            frames.push(late.receive());
        }
        frames
    });
    // All work has begun: the arm has made twelve ticks meanwhile.
    ticks(&mut watchers[0], 12);
    signal(runtime.pid(), "TERM");
    let (status, took) = runtime.end();
    // The documented second, and one more for a machine that is busy with other tests.
    assert!(
        status.success() && took < Duration::from_secs(2),
        "{status}, {took:?}"
    );
    flooding.join().unwrap();
    let frames = reading.join().unwrap();
    let numbers = frames
        .iter()
        .filter(|frame| frame["op"] == "publish")
        .count();
    assert_eq!(numbers, 30, "every message");
    let pending = frames.last().unwrap();
    assert_eq!(
        (&pending["result"], &pending["status"]),
        (&json!(false), &json!("shutting down"))
    );
    for client in &mut computing {
        let response = client.receive();
        assert_eq!(
            (&response["id"], &response["status"]),
            (&json!(7), &json!("shutting down"))
        );
        assert!(client.is_closed());
    }
    for client in &mut watchers {
        assert!(client.is_closed());
    }
}
