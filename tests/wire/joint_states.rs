//! `/joint_states` from outside.

use std::time::{Duration, Instant};

use crate::arm::{in_one_of_three_tries, stamp};
use crate::common::Runtime;
use serde_json::json;

#[test]
fn the_header_carries_simulation_time_and_the_world() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    let began = Instant::now();
    client.ask("/arm_sim/reset", json!({}));
    let mut last = 0.0;
    for _ in 0..60 {
        let state = client.message("/joint_states");
        assert_eq!(state["header"]["frame_id"], "world");
        assert_eq!(state["header"].as_object().unwrap().len(), 2);
        let now = stamp(&state);
        assert!(now >= last, "{now} after {last}");
        // Whole milliseconds: the timestep.
        let steps = now / 0.001;
        assert!((steps - steps.round()).abs() < 1e-6, "{now}");
        last = now;
    }
    assert!(last <= began.elapsed().as_secs_f64() + 0.5, "{last}");
}

/// Sixty a second by design. A busy machine may skip ticks, never make them up: no more than there are in the time, and
/// in one of three tries no fewer than half.
fn assert_sixty_a_second(paused: bool) {
    in_one_of_three_tries("60 Hz", || {
        let runtime = Runtime::start();
        let mut clients = [runtime.connect(), runtime.connect()];
        // Messages that are counted may have come from the first subscription on.
        let began = Instant::now();
        for client in &mut clients {
            client.ask("/arm_sim/pause", json!({"data": paused}));
            client.subscribe("/joint_states");
        }
        let [mut one, mut two] = clients;
        let time = Duration::from_secs(2);
        let reading = std::thread::spawn(move || two.receive_for(time).len());
        let seen = one.receive_for(time);
        let other = reading.join().unwrap();
        let most = (began.elapsed().as_secs_f64() * 60.0) as usize + 3;
        assert!(
            seen.len() <= most && other <= most,
            "{} and {other} of {most}",
            seen.len()
        );
        let enough = seen.len() >= 60 && other >= 60;
        enough
            .then_some(())
            .ok_or(format!("{} and {other}", seen.len()))
    });
}

#[test]
fn messages_come_sixty_times_a_second_to_every_subscriber() {
    assert_sixty_a_second(false);
}

#[test]
fn a_paused_arm_is_published_at_the_same_rate() {
    assert_sixty_a_second(true);
}
