//! Contract section 7: SIGINT and SIGTERM end the program within a second, and what waits is answered.
//!
//! **Invariant:** nothing that a client does keeps the program from ending, with exit status 0.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does"
)]

mod common;

use std::process::Command;
use std::time::{Duration, Instant};

use common::{Client, PATIENCE, Runtime};
use serde_json::{Value, json};

/// The contract's second, and one more for a machine that is busy with other tests.
const LIMIT: Duration = Duration::from_secs(2);

fn signal(runtime: &Runtime, name: &str) {
    let status = Command::new("kill")
        .args([&format!("-{name}"), &runtime.pid().to_string()])
        .status()
        .expect("kill runs");
    assert!(status.success());
}

/// Sends the signal; the program must end in time, with status 0.
fn ends_on(runtime: &mut Runtime, name: &str) {
    signal(runtime, name);
    let began = Instant::now();
    let status = runtime.wait(PATIENCE).expect("the program ends");
    assert!(status.success(), "{status}");
    assert!(began.elapsed() < LIMIT, "it took {:?}", began.elapsed());
}

/// All frames up to the end of the stream, however it ends.
fn rest(client: &mut Client) -> Vec<Value> {
    let mut bytes = Vec::new();
    let _ = std::io::Read::read_to_end(&mut client.stream(), &mut bytes);
    bytes
        .split(|&byte| byte == b'\n')
        .filter_map(|line| serde_json::from_slice(line).ok())
        .collect()
}

#[test]
fn a_signal_ends_an_idle_program() {
    for name in ["INT", "TERM"] {
        ends_on(&mut Runtime::start(), name);
    }
}

#[test]
fn a_signal_ends_a_program_with_clients_that_watch_flood_or_never_read() {
    let mut runtime = Runtime::start();
    let mut watchers: Vec<Client> = (0..10).map(|_| runtime.connect()).collect();
    for client in &mut watchers {
        client.subscribe("/joint_states");
    }
    let mut deaf = runtime.connect();
    deaf.send(&json!({"op": "advertise", "topic": "/big"}));
    deaf.subscribe("/big");
    let blob = "x".repeat(1_000_000);
    for _ in 0..20 {
        deaf.send(&json!({"op": "publish", "topic": "/big", "msg": {"data": blob}}));
    }
    let flood = runtime.connect().stream().try_clone().unwrap();
    let flooding = std::thread::spawn(move || {
        let frame = b"{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\"}\n".repeat(100);
        while std::io::Write::write_all(&mut &flood, &frame).is_ok() {}
    });
    std::thread::sleep(Duration::from_millis(100));
    ends_on(&mut runtime, "TERM");
    flooding.join().unwrap();
    for client in &mut watchers {
        assert!(client.is_closed());
    }
}

#[test]
fn pending_calls_are_told_that_the_program_is_shutting_down() {
    let mut runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provider.send(&json!({"op": "advertise_service", "service": "/s"}));
    provider.status();
    for id in 0..5 {
        caller.send(&json!({"op": "call_service", "service": "/s", "id": id}));
    }
    // Seconds of work each, of which one runs and sixteen wait.
    for id in 5..22 {
        caller.send(
            &json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
            "args": {"function": "sin(sin(sin(sin(t))))^2+cos(cos(cos(t)))^3+exp(sin(t))", "x0": 0,
                "dt": 1e-3, "steps": 1_000_000, "integrator": "rk4"}}),
        );
    }
    for _ in 0..5 {
        provider.receive();
    }
    std::thread::sleep(Duration::from_millis(100));
    ends_on(&mut runtime, "INT");
    let frames = rest(&mut caller);
    let mut ids: Vec<u64> = frames
        .iter()
        .filter_map(|frame| frame["id"].as_u64())
        .collect();
    ids.sort_unstable();
    assert_eq!(
        ids,
        (0..22).collect::<Vec<_>>(),
        "every call is answered once"
    );
    for frame in frames {
        assert_eq!(frame["result"], false, "{frame}");
        assert_eq!(frame["values"], json!({}));
        assert_eq!(frame["status"], "shutting down");
    }
}
