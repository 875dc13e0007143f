//! Trials of the running program: the option for the seed, and steps longer than any clock.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const START: &str = "/ik_trial/start";
const STATUS: &str = "/ik_trial/status";

fn first_target(client: &mut Client) -> Value {
    client.subscribe(STATUS);
    client.ask(START, json!({}));
    client.message(STATUS)["target"].clone()
}

#[test]
fn the_seed_option_repeats_the_targets_and_without_it_they_differ() {
    let target = |arguments: &[&str]| first_target(&mut Runtime::with(arguments).connect());
    let seeded = target(&["--seed", "42"]);
    assert_eq!(target(&["--seed", "42"]), seeded);
    assert_ne!(target(&["--seed", "43"]), seeded);
    assert_ne!(target(&[]), target(&[]));
}

fn status_where(client: &mut Client, wanted: impl Fn(&Value) -> bool) -> Value {
    let is_wanted = |frame: &Value| frame["topic"] == STATUS && wanted(&frame["msg"]);
    client.receive_where(STATUS, is_wanted)["msg"].take()
}

/// A step by hand may be longer than any clock can tell; a reset makes all good again.
#[test]
fn a_trial_after_steps_of_ages_and_a_reset_lasts_as_long_as_ever() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for timestep in [1e17, 1e308] {
        // At rest and without gravity the arm stays where it is however long a step lasts.
        client.ask("/arm_sim/pause", json!({"data": true}));
        client.ask("/arm_sim/reset", json!({}));
        client.ask("/arm_sim/set_params", json!({"gravity": 0}));
        client.ask("/arm_sim/set_integrator", json!({"timestep": timestep}));
        // The second of the longest would end beyond all numbers: the simulation diverges.
        let stepped = client.call("/arm_sim/step", json!({"steps": 3}));
        assert_eq!(stepped["result"], timestep < 1e308, "{stepped}");
        client.ask("/arm_sim/set_integrator", json!({"timestep": 0.001}));
        client.ask("/arm_sim/reset", json!({}));
        client.ask(START, json!({"duration": 0.5}));
        client.ask("/arm_sim/step", json!({"steps": 400}));
        // Subscribed only now, and by a client of its own: a status of the trial before can't come.
        let mut observer = runtime.connect();
        observer.subscribe(STATUS);
        let status = status_where(&mut observer, |status| status["elapsed"] != 0.0);
        assert_eq!(status["running"], true, "{timestep}: {status}");
        client.ask("/arm_sim/step", json!({"steps": 200}));
        let status = status_where(&mut observer, |status| status["running"] == false);
        assert_eq!(status["elapsed"], 0.5, "{timestep}: {status}");
    }
}
