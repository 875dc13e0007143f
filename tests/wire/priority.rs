//! With more threads than cores, threads that work for one client have a lower priority than the arm and the gateway.
//!
//! **Invariant:** it runs only on Linux, which has a priority for each thread.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde_json::json;

use crate::common::{PATIENCE, Runtime, stat};

/// The niceness of the program's threads, by their names.
fn niceness(runtime: &Runtime) -> BTreeMap<String, i32> {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", runtime.pid())).unwrap();
    tasks
        .map(|task| {
            let (name, fields) = stat(task.unwrap().path().join("stat"));
            // The 19th.
            (name, fields[16].parse().unwrap())
        })
        .collect()
}

#[test]
fn threads_that_work_for_one_client_have_lower_priority() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // So long that it is read on a worker thread.
    let id = "x".repeat(300_000);
    client.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "args": {"id": id}}));
    assert_eq!(client.receive()["op"], "service_response");

    // A thread sets its name and lowers its priority once it runs.
    let deadline = Instant::now() + PATIENCE;
    loop {
        let niceness = niceness(&runtime);
        if is_as_it_must_be(&niceness) {
            return;
        }
        assert!(Instant::now() < deadline, "{niceness:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Whether the threads that work for one client have a niceness of five more than the others, which are equal. Each thread has
/// the name of its work.
fn is_as_it_must_be(niceness: &BTreeMap<String, i32>) -> bool {
    let for_all = niceness["pendularm"];
    let (for_one, others): (Vec<_>, Vec<_>) = niceness
        .iter()
        .partition(|(name, _)| name.starts_with("worker-") || *name == "long-work");
    // The scale ends there, if the tests themselves have a high niceness.
    let behind = (for_all + 5).min(19);
    let has_arm = others.iter().any(|(name, _)| *name == "arm_sim");
    has_arm
        && for_one.len() >= 2
        && for_one.iter().all(|(_, theirs)| **theirs == behind)
        && others.iter().all(|(_, theirs)| **theirs == for_all)
}
