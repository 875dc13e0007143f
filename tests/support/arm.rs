//! Parts that the tests of the arm share: reading its messages, and waiting for its time.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common::{Client, PATIENCE};

/// Simulation time in the header of a message, in s.
pub fn stamp(message: &Value) -> f64 {
    time(&message["header"]["stamp"])
}

/// A `builtin_interfaces/msg/Time` in s.
pub fn time(stamp: &Value) -> f64 {
    let sec = stamp["sec"].as_f64().expect("sec");
    let nanosec = stamp["nanosec"].as_u64().expect("nanosec");
    assert!(nanosec < 1_000_000_000, "{stamp}");
    // A division is rounded correctly, so the stamped time is returned.
    sec + nanosec as f64 / 1e9
}

/// The present state: the first `/joint_states` after the response to a call, since older messages arrive before the
/// response. The client must have subscribed.
pub fn state(client: &mut Client) -> Value {
    client.settle();
    client.kept.clear();
    client.message("/joint_states")
}

/// Waits for a state for which `wanted` holds.
pub fn state_where(client: &mut Client, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
    state_within(client, PATIENCE, what, wanted)
}

fn state_within(
    client: &mut Client,
    patience: Duration,
    what: &str,
    wanted: impl Fn(&Value) -> bool,
) -> Value {
    let deadline = Instant::now() + patience;
    let mut last = Value::Null;
    while Instant::now() < deadline {
        last = client.message("/joint_states");
        client.kept.clear();
        if wanted(&last) {
            return last;
        }
    }
    panic!("no {what} in time; the last state was {last}");
}

/// Waits until `time` of simulation time has passed \[s\], and discards all frames. The client subscribes to
/// `/joint_states`.
pub fn let_simulate(client: &mut Client, time: f64) {
    let end = stamp(&state(client)) + time;
    let patience = PATIENCE + Duration::from_secs_f64(time);
    state_within(client, patience, "end of the wait", |state| {
        stamp(state) >= end
    });
}

/// Retries a check that a correct runtime may fail on a busy machine, and that a wrong one never passes.
pub fn in_one_of_three_tries(what: &str, attempt: impl Fn() -> Result<(), String>) {
    let mut failures = Vec::new();
    for _ in 0..3 {
        match attempt() {
            Ok(()) => return,
            Err(failure) => failures.push(failure),
        }
    }
    panic!("{what}: {failures:?}");
}
