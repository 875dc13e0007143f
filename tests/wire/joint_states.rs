//! `/joint_states` from outside.

use std::time::{Duration, Instant};

use crate::arm::{in_one_of_three_tries, numbers, stamp, state_where, ticks};
use crate::common::{PATIENCE, Runtime};
use serde_json::{Value, json};

#[test]
fn a_message_names_every_joint_and_gives_it_a_position_a_velocity_and_an_effort() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        client.subscribe("/joint_states");
        for _ in 0..10 {
            let state = client.message("/joint_states");
            let mut keys: Vec<&String> = state.as_object().unwrap().keys().collect();
            keys.sort();
            assert_eq!(keys, ["effort", "header", "name", "position", "velocity"]);
            let names: Vec<String> = (1..=links).map(|joint| format!("joint{joint}")).collect();
            assert_eq!(state["name"], json!(names));
            for field in ["position", "velocity", "effort"] {
                assert_eq!(numbers(&state[field]).len(), links, "{field}");
            }
        }
    }
}

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

#[test]
fn a_client_that_has_unsubscribed_hears_nothing_more() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.message("/joint_states");
    client.send(&json!({"op": "unsubscribe", "topic": "/joint_states"}));
    client.settle();
    client.kept.clear();
    // A client that is still subscribed hears of twenty ticks meanwhile.
    let mut other = runtime.connect();
    other.subscribe("/joint_states");
    ticks(&mut other, 20);
    client.settle();
    assert_eq!(client.kept, Vec::<Value>::new());
    client.subscribe("/joint_states");
    client.message("/joint_states");
}

#[test]
fn a_large_timestep_shows_the_same_state_until_the_next_step() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/arm_sim/set_params", json!({"gravity": 0}));
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.25}));
    client.ask("/arm_sim/reset", json!({}));
    let mut stamps = vec![stamp(&state_where(&mut client, "a second", |state| {
        stamp(state) >= 1.0
    }))];
    let deadline = Instant::now() + PATIENCE;
    while stamps.len() < 3 {
        assert!(Instant::now() < deadline, "no step is done: {stamps:?}");
        stamps.push(stamp(&client.message("/joint_states")));
        stamps.dedup();
    }
    assert!(
        stamps.iter().all(|stamp| (stamp * 4.0).fract() == 0.0),
        "{stamps:?}"
    );
}
