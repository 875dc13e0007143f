//! One slow or dead client never delays another, and costs a bounded amount of memory.
//!
//! **Invariant:** nothing here is told by a clock: the fast client goes in lockstep, the slow one is shown by counts and
//! by the program's peak memory.

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::common::{PATIENCE, Runtime, provide};
use crate::diagnostics::gateway_count;
use pendularm::actors::gateway::limits::MAX_BACKLOG;
use serde_json::json;

const MIB: usize = 1024 * 1024;
/// Memory that the program needs by itself, and that an allocator and a test build add.
const BASE: usize = 40 * MIB;

#[test]
fn a_subscriber_that_never_reads_delays_nobody_loses_the_oldest_and_is_counted() {
    let runtime = Runtime::start();
    let mut deaf = runtime.connect();
    deaf.subscribe("/t");
    let mut client = runtime.connect();
    client.send(&json!({"op": "advertise", "topic": "/t"}));
    client.subscribe("/t");
    // 100 MiB, of which the deaf client's outbox takes one message and the system's buffers some.
    let blob = "x".repeat(MIB / 4);
    for n in 0..400 {
        client.send(&json!({"op": "publish", "topic": "/t", "msg": {"n": n, "blob": blob}}));
        assert_eq!(
            client.message("/t")["n"],
            n,
            "in lockstep, so nothing is lost"
        );
    }
    let peak = runtime.peak_memory();
    assert!(peak < BASE, "{peak} bytes");
    client.subscribe("/diagnostics");
    let dropped = gateway_count(&mut client, "messages_dropped");
    assert!(dropped > 200, "{dropped} of 400");

    // More of the messages that still wait grow too old.
    let mut received = vec![];
    while received.last() != Some(&399) {
        received.push(deaf.message("/t")["n"].as_u64().unwrap());
    }
    assert!(
        received.is_sorted_by(|a, b| a < b),
        "reordered: {received:?}"
    );
    let dropped = gateway_count(&mut client, "messages_dropped");
    assert_eq!(
        received.len() as u64,
        400 - dropped,
        "what is not dropped arrives"
    );
}

#[test]
fn responses_that_nobody_reads_stop_the_reading_and_are_never_dropped() {
    const CALLS: usize = 1000;
    const LENGTH: usize = 10_000;
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut stream = client.stream().try_clone().unwrap();
    let sent = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&sent);
    let id = "x".repeat(LENGTH);
    let sending = std::thread::spawn(move || {
        for n in 0..CALLS {
            let frame = json!({"op": "call_service", "service": "/arm_sim/pause", "id": format!("{n} {id}")});
            stream.write_all(format!("{frame}\n").as_bytes()).unwrap();
            count.store(n + 1, Ordering::Relaxed);
        }
    });
    // It comes to a stand once as much waits as may, and nobody else notices. A machine may stand still earlier.
    let mut other = runtime.connect();
    let (mut before, mut since) = (0, Instant::now());
    let deadline = since + PATIENCE;
    while before < 10 || since.elapsed() < Duration::from_millis(500) {
        assert!(
            Instant::now() < deadline,
            "{before} calls are under the limit, or it never stands"
        );
        other.settle();
        let now = sent.load(Ordering::Relaxed);
        if now != before {
            (before, since) = (now, Instant::now());
        }
    }
    assert!(
        before < CALLS,
        "everything was read although nothing was taken"
    );
    let peak = runtime.peak_memory();
    assert!(peak < BASE, "{peak} bytes");
    for n in 0..CALLS {
        let response = client.receive();
        let id = response["id"].as_str().unwrap();
        assert_eq!(id.len(), LENGTH + n.to_string().len() + 1);
        assert!(id.starts_with(&format!("{n} ")), "out of order at {n}");
    }
    sending.join().unwrap();
}

#[test]
fn a_provider_that_never_reads_costs_its_callers_a_refusal_and_not_the_memory() {
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

/// As for calls and goals: nobody fills the memory, and nobody ends another's connection, by asking a goal's end again
/// and again.
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

/// A flood is read as fast as the arm takes it: the others' calls go in between. Without that they would wait for
/// all of it, minutes.
#[test]
fn a_flood_of_trajectories_delays_nobody() {
    let runtime = Runtime::start();
    let stop = Arc::new(AtomicBool::new(false));
    let floods: Vec<_> = (0..3)
        .map(|_| {
            let stream = runtime.connect().stream().try_clone().unwrap();
            let stop = Arc::clone(&stop);
            std::thread::spawn(move || {
                let frame = json!({"op": "publish", "topic": "/joint_trajectory",
                    "msg": {"points": [{"positions": [0.1, 0.2]}]}});
                let frames = format!("{frame}\n").repeat(500);
                while !stop.load(Ordering::Relaxed) {
                    (&stream).write_all(frames.as_bytes()).unwrap();
                }
            })
        })
        .collect();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    let began = Instant::now();
    for _ in 0..20 {
        client.settle();
        client.kept.clear();
    }
    for _ in 0..10 {
        client.message("/joint_states");
    }
    assert!(began.elapsed() < PATIENCE, "{:?}", began.elapsed());
    stop.store(true, Ordering::Relaxed);
    for flood in floods {
        flood.join().unwrap();
    }
}
