//! Trials of the running program, as any client meets them.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

const START: &str = "/ik_trial/start";
const STATUS: &str = "/ik_trial/status";

/// Two targets take some three seconds with 2 links, some five with 3; the wait is limited by the client's patience.
fn sees_two_targets_reached(links: usize) {
    let runtime = Runtime::with_links(links);
    let mut client = runtime.connect();
    client.subscribe(STATUS);
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask(START, json!({}));
    let status = client.receive_where("two targets reached", |frame| {
        frame["msg"]["targets_reached"] == 2
    });
    let status = &status["msg"];
    assert_eq!(status["running"], true);
    assert_eq!(status["action_status"], "reached");
    assert!(status["error"].as_f64().unwrap() <= 0.02);
    let positions = status["desired_positions"].as_array().unwrap();
    assert_eq!(positions.len(), links);
    assert!(client.kept.iter().any(|frame| {
        frame["msg"]["targets_reached"] == 1 && frame["msg"]["action_status"] == "active"
    }));
}

#[test]
fn a_client_that_only_enables_and_starts_sees_targets_reached_with_2_links() {
    sees_two_targets_reached(2);
}

#[test]
fn a_client_that_only_enables_and_starts_sees_targets_reached_with_3_links() {
    sees_two_targets_reached(3);
}

/// Never a running trial with a goal that nobody has accepted.
#[test]
fn the_first_status_after_start_and_skip_shows_the_goal_as_accepted() {
    for links in [2, 3] {
        let runtime = Runtime::with_links(links);
        let mut client = runtime.connect();
        client.subscribe(STATUS);
        let mut targets = Vec::new();
        for service in [START, "/ik_trial/skip", START] {
            client.settle();
            client.kept.clear();
            client.ask(service, json!({}));
            let status = client.message(STATUS);
            assert_eq!(
                (&status["running"], &status["action_status"]),
                (&json!(true), &json!("active")),
                "{status}"
            );
            assert_eq!(status["target"]["phi"].is_number(), links == 3);
            assert!(!targets.contains(&status["target"]), "a new target");
            targets.push(status["target"].clone());
        }
    }
}

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

#[test]
fn envelopes_and_rejections_are_as_documented() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in ["/ik_trial/skip", "/ik_trial/stop"] {
        let response = client.call(service, json!({}));
        assert_eq!(response["result"], false);
        assert_eq!(response["values"], json!({}));
    }
    let values = client.ask(START, json!({"duration": 30, "epsilon": 0.05}));
    assert_eq!(
        values,
        json!({"duration": 30.0, "epsilon": 0.05, "success_hold": 0.5})
    );
    assert_eq!(client.ask("/ik_trial/skip", json!({})), json!({}));
    assert_eq!(client.ask("/ik_trial/stop", json!({})), json!({}));
    client.refusal("/ik_trial/stop", json!({}));
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
