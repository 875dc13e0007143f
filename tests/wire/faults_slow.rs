//! Slow tests of faults: `make test-slow` runs these.
//!
//! **Invariant:** the measured memory is the peak of the program, in a test build.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::arm::{stamp, state};
use crate::common::{Client, PATIENCE, Runtime, provide};
use crate::folder::Folder;
use pendularm::actors::gateway::limits::MAX_MEMORY;
use serde_json::{Value, json};

const MIB: usize = 1024 * 1024;
const STEP: &str = "/arm_sim/integration_step";

/// Fifty clients ask for 60 MB each and read nothing for a while. There is room for one such answer, so each is computed
/// once the one before has been read.
#[test]
#[ignore = "a minute: make test-slow"]
fn fifty_clients_that_read_nothing_of_a_million_steps_use_bounded_memory() {
    const STEPS: usize = 1_000_000;
    let runtime = Runtime::start();
    let mut deaf: Vec<Client> = (0..50).map(|_| runtime.connect()).collect();
    for (id, client) in deaf.iter_mut().enumerate() {
        client.send(&json!({"op": "call_service", "service": STEP, "id": id,
            "args": {"function": "sin(t)", "x0": 1.0 / 3.0, "dt": 1e-3, "steps": STEPS,
                "integrator": "euler"}}));
    }
    // An answer waits for 20 s at most before its client counts as dead.
    let mut honest = runtime.connect();
    let mut answers = Vec::new();
    std::thread::scope(|scope| {
        let reading: Vec<_> = deaf
            .iter_mut()
            .map(|client| {
                scope.spawn(|| {
                    // Each client reads nothing for a while.
                    std::thread::sleep(Duration::from_secs(12));
                    client.set_patience(Duration::from_secs(600));
                    let line = client.receive_text();
                    let response: Value = serde_json::from_str(&line).unwrap();
                    let whole = response["values"]["velocities"].as_array().map(Vec::len);
                    (
                        response["id"].clone(),
                        response["result"] == true,
                        whole,
                        response["status"].clone(),
                    )
                })
            })
            .collect();
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(12) {
            honest.settle();
            let few = honest.ask(
                STEP,
                json!({"function": "t", "x0": 0, "dt": 1, "steps": 10,
                "integrator": "rk4"}),
            );
            assert_eq!(few["times"].as_array().unwrap().len(), 11);
        }
        answers.extend(reading.into_iter().map(|thread| thread.join().unwrap()));
    });
    let peak = runtime.peak_memory();
    println!("peak {} MiB", peak / MIB);
    for (n, (id, result, length, status)) in answers.iter().enumerate() {
        assert_eq!((id, result), (&json!(n), &true), "{status}");
        assert_eq!(*length, Some(STEPS + 1));
    }
    assert!(peak < MAX_MEMORY, "{peak} bytes");
}

/// The wall clock jumps an hour forward and a day back: no timeout is affected. Needs Debian's `libfaketime`.
#[test]
#[ignore = "needs libfaketime: make test-slow"]
fn a_wall_clock_that_jumps_changes_nothing() {
    let library = std::fs::read_dir("/usr/lib")
        .unwrap()
        .map(|folder| folder.unwrap().path().join("faketime/libfaketime.so.1"))
        .find(|library| library.exists())
        .expect("libfaketime is installed: apt-get install libfaketime");
    let library = library.to_str().unwrap();
    let folder = Folder::new("clock");
    let file = folder.join("offset");
    std::fs::write(&file, "+0\n").unwrap();
    let runtime = Runtime::under(&format!(
        "export LD_PRELOAD={library} FAKETIME_TIMESTAMP_FILE={} FAKETIME_NO_CACHE=1 DONT_FAKE_MONOTONIC=1",
        file.display()
    ));
    let mut client = runtime.connect();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provide(&mut provider, "/s");
    client.subscribe("/joint_states");
    for jump in ["+1h", "-1d", "+0"] {
        caller.send(&json!({"op": "call_service", "service": "/s", "id": jump, "timeout": 60}));
        let call = provider.receive();
        let began = Instant::now();
        let before = stamp(&state(&mut client));
        std::fs::write(&file, format!("{jump}\n")).unwrap();
        // More than the 250 ms that an arm catches up at once: simulation time and messages continue.
        let (mut simulated, mut messages) = (0.0, 0);
        while simulated < 0.5 {
            simulated = stamp(&client.message("/joint_states")) - before;
            messages += 1;
            let wall = began.elapsed().as_secs_f64();
            assert!(wall < PATIENCE.as_secs_f64(), "it stands after {jump}");
            assert!(
                simulated <= wall + 0.3,
                "{simulated} s in {wall} s after {jump}"
            );
            assert!(
                f64::from(messages) <= 60.0 * wall + 3.0,
                "{messages} messages in {wall} s after {jump}"
            );
        }
        // A waiting call is neither lost nor timed out.
        provider.send(
            &json!({"op": "service_response", "service": "/s", "id": call["id"],
            "values": {}, "result": true}),
        );
        assert_eq!(caller.receive()["result"], true);
    }
    let seen = Command::new("sh")
        .args([
            "-c",
            "LD_PRELOAD=$0 FAKETIME='+1h' date +%s; date +%s",
            library,
        ])
        .output()
        .unwrap();
    let seen = String::from_utf8(seen.stdout).unwrap();
    let seconds: Vec<i64> = seen.lines().map(|line| line.parse().unwrap()).collect();
    assert!(
        seconds[0] - seconds[1] > 3000,
        "the library does move clocks: {seen}"
    );
    std::fs::remove_file(&file).unwrap();
}
