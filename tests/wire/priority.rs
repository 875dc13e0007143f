//! Where threads are more than cores, those that work for one client give way to the arm and the gateway, which work
//! for all.
//!
//! **Invariant:** only Linux is asked, which has a priority for each thread.

use std::collections::BTreeMap;

use serde_json::json;

use crate::common::{Runtime, stat};

/// How far the program's threads step back behind others, by their names.
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
fn who_works_for_one_client_gives_way_to_the_arm_and_the_gateway() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // So long that it is read aside.
    let id = "x".repeat(300_000);
    client.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "args": {"id": id}}));
    assert_eq!(client.receive()["op"], "service_response");

    let niceness = niceness(&runtime);
    let for_all = niceness["pendularm"];
    let (for_one, others): (Vec<_>, Vec<_>) = niceness
        .iter()
        .partition(|(name, _)| name.starts_with("worker-") || name.starts_with("tokio-"));
    assert!(for_one.len() >= 2, "{niceness:?}");
    // The scale ends there, should the tests step back themselves.
    let behind = (for_all + 5).min(19);
    assert!(
        for_one.iter().all(|(_, theirs)| **theirs == behind),
        "{niceness:?}"
    );
    assert!(
        others.iter().all(|(_, theirs)| **theirs == for_all),
        "{niceness:?}"
    );
}
