//! A client that pauses gets all messages that its socket holds. `tests/protocol/outbox/pacing.rs` simulates pauses and
//! slow clients.

use std::thread::sleep;
use std::time::Duration;

use crate::common::{Client, Runtime};
use serde_json::json;

/// The time for which a client reads nothing.
const PAUSE: Duration = Duration::from_secs(4);
/// The messages of that time, at 60 a second, on a busy machine that skips some.
const LEAST: usize = 220;

/// The stamp of a joint state in simulation time \[s\].
fn stamp(message: &serde_json::Value) -> f64 {
    let stamp = &message["msg"]["header"]["stamp"];
    stamp["sec"].as_f64().unwrap() + stamp["nanosec"].as_f64().unwrap() / 1e9
}

#[test]
fn a_client_that_pauses_gets_every_message_of_its_pause_and_the_newest() {
    let runtime = Runtime::start();
    let mut clients = [runtime.connect(), Client::web(runtime.address)];
    for client in &mut clients {
        client.send(&json!({"op": "subscribe", "topic": "/joint_states"}));
    }
    sleep(PAUSE);
    for client in &mut clients {
        let messages = client.receive_for(Duration::from_millis(300));
        let stamps: Vec<f64> = messages
            .iter()
            .filter(|one| one["op"] == "publish")
            .map(stamp)
            .collect();
        assert!(stamps.len() > LEAST, "{} messages", stamps.len());
        assert!(stamps.is_sorted());
        let longest = stamps
            .windows(2)
            .map(|two| two[1] - two[0])
            .fold(0.0, f64::max);
        assert!(longest < 0.25, "a gap of {longest} s");
        let (first, last) = (stamps[0], stamps[stamps.len() - 1]);
        assert!(last - first > PAUSE.as_secs_f64(), "{first} to {last}");
    }
}
