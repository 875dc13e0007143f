//! A provider that never reads costs its callers a refusal, and the program a bounded amount of memory.
//!
//! **Invariant:** nothing here is timed: refusals are counted, and memory is the program's peak.

use crate::common::{Runtime, provide};
use pendularm::actors::gateway::limits::MAX_BACKLOG;
use serde_json::json;

const MIB: usize = 1024 * 1024;
/// Memory of the program itself, with the additions of an allocator and a test build.
const BASE: usize = 40 * MIB;

#[test]
fn calls_of_a_provider_that_never_reads_are_refused_and_use_bounded_memory() {
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
