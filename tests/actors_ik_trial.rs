//! Trials from end to end, in virtual time: what is sampled, counted and reported, and what happens when others meddle.
//!
//! Where the arm floats, at rest and weightless, and epsilon is as large as the world, every target is reached at once:
//! after one step that finds the hand there, and `success_hold` more. Then counts and times can be told beforehand.

mod stage;

use std::sync::atomic::Ordering;

use actix::prelude::*;
use pendularm::actors::arm_sim::{ArmPose, EndGoal, GoalJudged, Pose, TrackGoal, Tracking};
use pendularm::actors::ik_action::GoalTracker;
use pendularm::actors::registry::{Attach, Nodes, Registry};
use pendularm::math::pid::Gains;
use serde_json::{Value, json};
use stage::{Client, Stage, connect, counting_wake_ups, in_virtual_time, ms, number, pass};

const START: &str = "/ik_trial/start";
const SKIP: &str = "/ik_trial/skip";
const STOP: &str = "/ik_trial/stop";
const STATUS: &str = "/ik_trial/status";
const RESULT: &str = "/ik_action/result";
const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";

/// Differences of simulation times: a few units in the last place of 100 s.
const ROUNDING: f64 = 1e-12;

/// Targets that a floating arm reaches after 1 ms and `success_hold`.
fn easy(duration: f64, success_hold: f64) -> Value {
    json!({"duration": duration, "epsilon": 1e6, "success_hold": success_hold})
}

/// Targets that a floating arm never reaches.
fn hard(duration: f64) -> Value {
    json!({"duration": duration, "epsilon": 1e-9, "success_hold": 0})
}

/// The latest status, once all that is under way has arrived.
async fn status(client: &mut Client) -> Value {
    client.messages_for(ms(101), STATUS).await.pop().unwrap()
}

async fn floating_and_watched() -> (Stage<2>, Client) {
    let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
    client.subscribe(STATUS).await;
    client.subscribe(RESULT).await;
    client.heard.clear();
    (stage, client)
}

/// What is left when nothing is pursued any more.
fn assert_nothing_in_flight(status: &Value) {
    for field in ["target", "error", "desired_positions"] {
        assert_eq!(status[field], Value::Null, "{field}");
    }
    assert_eq!(status["action_status"], "idle");
}

// ---- the whole thing ------------------------------------------------------------------------------------------------

async fn targets_per_minute<const N: usize>() -> u64
where
    Gains<N>: Default,
{
    let stage = Stage::<N>::start().await;
    let mut client = stage.connect();
    client.subscribe(STATUS).await;
    client.enable().await;
    client.ask(START, json!({})).await;
    let end = client
        .next_where(|frame| frame["topic"] == STATUS && frame["msg"]["running"] == false)
        .await;
    assert_eq!(end["msg"]["elapsed"], json!(60.0));
    let reached = end["msg"]["targets_reached"].as_u64().unwrap();
    let reported = client
        .messages(STATUS)
        .iter()
        .filter(|status| status["action_status"] == "reached")
        .count();
    assert_eq!(reported as u64, reached, "each is reported once");
    reached
}

/// Over 50 seeds 38 to 41 targets a minute are reached with 2 links (39 on average), 24 to 30 with 3 (27).
#[test]
fn a_client_that_only_enables_and_starts_sees_targets_reached_counted_and_reported() {
    in_virtual_time(async {
        let two = targets_per_minute::<2>().await;
        let three = targets_per_minute::<3>().await;
        assert!((36..=43).contains(&two), "{two} with 2 links");
        assert!((22..=32).contains(&three), "{three} with 3 links");
    });
}

async fn targets_of(seed: u64) -> Vec<Value> {
    let stage = Stage::<3>::with_seed(seed).await;
    let mut client = stage.connect();
    client.subscribe(STATUS).await;
    client.ask(START, easy(1.0, 0.01)).await;
    client.messages_for(ms(1100), STATUS).await;
    client
        .messages(STATUS)
        .iter()
        .map(|status| status["target"].clone())
        .collect()
}

#[test]
fn a_seed_makes_the_targets_repeatable() {
    in_virtual_time(async {
        let first = targets_of(7).await;
        assert!(first.len() > 50);
        assert_eq!(first, targets_of(7).await);
        assert_ne!(first, targets_of(8).await);
    });
}

/// Reachable whatever the lengths: none of the goals is refused, which would show as `idle` after the first `active`.
#[test]
fn targets_are_reachable_at_any_lengths_also_when_these_change_during_the_trial() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, easy(60.0, 0.0)).await;
        for lengths in [[1e-3, 1e3], [5.0, 1e-6], [2.0, 2.0], [1e-5, 1e-5]] {
            let args = json!({"lengths": lengths});
            client.ask("/arm_sim/set_params", args).await;
            let before = client.messages(STATUS).len();
            client.messages_for(ms(500), STATUS).await;
            let statuses = client.messages(STATUS).split_off(before);
            let reached = |status: &&Value| status["action_status"] == "reached";
            assert!(statuses.iter().filter(reached).count() > 20);
            // The very first target may be one for the old lengths.
            for status in statuses.iter().skip(4) {
                let target = &status["target"];
                let distance = number(&target["x"]).hypot(number(&target["y"]));
                let [l1, l2]: [f64; 2] = lengths;
                assert!(((l1 - l2).abs()..=l1 + l2).contains(&distance));
            }
        }
    });
}

// ---- start ----------------------------------------------------------------------------------------------------------

#[test]
fn start_answers_with_the_settings_in_force_and_keeps_what_is_not_named() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        let defaults = json!({"duration": 60.0, "epsilon": 0.02, "success_hold": 0.5});
        assert_eq!(client.ask(START, json!({})).await, defaults);
        let values = client.ask(START, json!({"epsilon": 0.1})).await;
        assert_eq!(values["epsilon"], 0.1);
        let values = client
            .ask(
                START,
                json!({"duration": 30, "success_hold": 0, "epsilon": null}),
            )
            .await;
        let kept = json!({"duration": 30.0, "epsilon": 0.1, "success_hold": 0.0});
        assert_eq!(values, kept);
        assert_eq!(client.ask(START, json!({})).await, kept);
    });
}

#[test]
fn start_with_an_invalid_field_is_rejected_and_changes_nothing_a_running_trial_included() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        let defaults = json!({"duration": 60.0, "epsilon": 0.02, "success_hold": 0.5});
        let response = client.call(START, json!({"duration": 0})).await;
        assert_eq!(response["result"], false);
        assert_eq!(response["values"], defaults);
        assert_eq!(response["status"], "duration must be greater than 0, got 0");
        let quiet = client.messages_for(ms(500), STATUS).await;
        assert!(quiet.is_empty(), "no trial exists");

        let values = client.ask(START, hard(50.0)).await;
        let before = status(&mut client).await;
        for (args, field) in [
            (json!({"duration": 5, "epsilon": -1}), "epsilon"),
            (json!({"duration": 5, "success_hold": "x"}), "success_hold"),
            (json!({"duration": true, "epsilon": 1}), "duration"),
        ] {
            let response = client.call(START, args).await;
            assert_eq!(response["result"], false);
            assert_eq!(response["values"], values);
            assert!(response["status"].as_str().unwrap().starts_with(field));
        }
        let after = status(&mut client).await;
        assert_eq!(after["target"], before["target"]);
        assert_eq!(after["duration"], before["duration"]);
        assert!(number(&after["elapsed"]) > number(&before["elapsed"]));
        assert!(client.messages(RESULT).is_empty());
    });
}

/// The sum of such lengths is beyond the number range, and with it every target.
#[test]
fn start_without_any_reachable_target_is_rejected_and_says_so() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client
            .ask(
                "/arm_sim/set_params",
                json!({"lengths": [1.5e308, 1.5e308]}),
            )
            .await;
        let response = client.call(START, json!({"duration": 5})).await;
        assert_eq!(response["result"], false, "{response}");
        assert!(response["status"].as_str().unwrap().contains("target"));
        assert_eq!(response["values"]["duration"], 60.0, "nothing has changed");
    });
}

#[test]
fn start_begins_afresh_and_cancels_the_goal_that_was_left_over() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, easy(60.0, 0.1)).await;
        client.messages_for(ms(1000), STATUS).await;
        let before = status(&mut client).await;
        assert!(number(&before["targets_reached"]) > 5.0);
        client.heard.clear();
        client.ask(START, hard(60.0)).await;
        let results = client.messages(RESULT);
        assert_eq!(results.len(), 1);
        assert_eq!(results[0]["outcome"], "preempted");
        let first = &client.messages(STATUS)[0];
        assert_eq!(first["running"], true);
        assert_eq!(first["targets_reached"], 0);
        assert_eq!(first["elapsed"], 0.0);
        assert_ne!(first["target"], before["target"]);
    });
}

#[test]
fn the_goal_is_under_way_when_start_is_answered_and_what_follows_finds_it() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        for (service, args) in [(START, hard(60.0)), (CANCEL, json!({})), (SKIP, json!({}))] {
            client
                .send(&json!({"op": "call_service", "service": service, "args": args}))
                .await;
        }
        client.send_goal(json!({"x": 1, "y": 1})).await;
        let results: Vec<bool> = client
            .heard
            .iter()
            .filter_map(|frame| frame["result"].as_bool())
            .collect();
        assert_eq!(results, [true; 4], "{:?}", client.heard);
        assert_eq!(client.messages(RESULT).len(), 2);
    });
}

// ---- skip and stop --------------------------------------------------------------------------------------------------

#[test]
fn skip_and_stop_are_rejected_when_no_trial_runs() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        for service in [SKIP, STOP] {
            let response = client.call(service, json!({})).await;
            assert_eq!(response["result"], false);
            assert_eq!(response["values"], json!({}));
            assert_eq!(response["status"], "no trial is running");
        }
        client.ask(START, easy(0.5, 0.1)).await;
        pass(ms(501)).await;
        client.refusal(SKIP, json!({})).await;
        client.refusal(STOP, json!({})).await;
    });
}

#[test]
fn skip_abandons_the_target_uncounted_and_goes_for_another_at_once() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(60.0)).await;
        let before = status(&mut client).await;
        client.heard.clear();
        assert_eq!(client.ask(SKIP, json!({})).await, json!({}));
        let results = client.messages(RESULT);
        assert_eq!(results.len(), 1);
        assert_eq!(results[0]["outcome"], "preempted");
        assert_eq!(results[0]["target"], before["target"]);
        let after = client.messages(STATUS).pop().unwrap();
        assert_eq!(after["action_status"], "active");
        assert_eq!(after["targets_reached"], 0);
        assert_ne!(after["target"], before["target"]);
        assert!(number(&after["elapsed"]) > 0.0, "the clock goes on");
    });
}

#[test]
fn stop_ends_the_trial_and_leaves_nothing_in_flight() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(60.0)).await;
        let before = status(&mut client).await;
        assert!(before["error"].is_number());
        client.heard.clear();
        assert_eq!(client.ask(STOP, json!({})).await, json!({}));
        assert_eq!(client.messages(RESULT).len(), 1);
        client.refusal(CANCEL, json!({})).await;
        for after in client.messages_for(ms(1000), STATUS).await {
            assert_eq!(after["running"], false);
            assert_nothing_in_flight(&after);
            // Its clock has stopped.
            assert!(number(&after["elapsed"]) - number(&before["elapsed"]) < 0.11);
        }
        assert_eq!(client.messages(RESULT).len(), 1, "and no replacement");
    });
}

// ---- duration -------------------------------------------------------------------------------------------------------

#[test]
fn when_its_duration_is_over_the_trial_ends_and_abandons_its_target() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(2.5)).await;
        client.messages_for(ms(2499), STATUS).await;
        assert_eq!(client.messages(STATUS).pop().unwrap()["running"], true);
        client.heard.clear();
        let end = client.message(STATUS).await;
        assert_eq!(end["running"], false);
        assert_eq!(end["elapsed"], 2.5);
        assert_eq!(end["duration"], 2.5);
        assert_nothing_in_flight(&end);
        client.settle().await;
        assert_eq!(client.messages(RESULT)[0]["outcome"], "preempted");
        assert_eq!(client.messages(RESULT).len(), 1);
    });
}

#[test]
fn a_duration_is_simulation_time_and_does_not_pass_while_the_arm_is_paused() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(1.0)).await;
        pass(ms(995)).await;
        client.ask("/arm_sim/pause", json!({"data": true})).await;
        client.messages_for(ms(60_000), STATUS).await;
        let paused = client.messages(STATUS).pop().unwrap();
        assert_eq!(paused["running"], true);
        assert!((number(&paused["elapsed"]) - 0.995).abs() < ROUNDING);
        client.ask("/arm_sim/pause", json!({"data": false})).await;
        client.messages_for(ms(50), STATUS).await;
        assert_eq!(client.messages(STATUS).pop().unwrap()["running"], false);
    });
}

/// The trial's first target is reached at 0.101 s; where the wake-ups of the arm fall must not matter.
#[test]
fn what_is_reached_within_the_duration_counts_and_what_is_reached_after_it_does_not() {
    in_virtual_time(async {
        for offset in 0..17 {
            for (duration, count) in [(0.1005, 0), (0.1015, 1), (0.11, 1)] {
                let (_stage, mut client) = floating_and_watched().await;
                pass(ms(offset)).await;
                client.ask(START, easy(duration, 0.1)).await;
                client.messages_for(ms(300), STATUS).await;
                let end = client.messages(STATUS).pop().unwrap();
                assert_eq!(end["running"], false);
                assert_eq!(end["targets_reached"], count, "{duration} at {offset} ms");
            }
        }
    });
}

#[test]
fn the_clock_never_runs_backwards_and_a_reset_adds_nothing() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(10.0)).await;
        let mut last = 0.0;
        for _ in 0..5 {
            client.messages_for(ms(730), STATUS).await;
            client.ask("/arm_sim/reset", json!({})).await;
            for status in client.messages(STATUS) {
                let elapsed = number(&status["elapsed"]);
                assert!(elapsed >= last);
                last = elapsed;
            }
            client.heard.clear();
        }
        // 3.65 s of simulation time have passed, of which a reset may have cut off an unfinished step each.
        client.ask(STOP, json!({})).await;
        let elapsed = number(&client.message(STATUS).await["elapsed"]);
        assert!(
            (3.645 - ROUNDING..=3.65 + ROUNDING).contains(&elapsed),
            "{elapsed}"
        );
    });
}

/// No timer can be set to such a time.
#[test]
fn a_trial_may_last_longer_than_any_timer() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        let values = client.ask(START, hard(1e300)).await;
        assert_eq!(values["duration"], 1e300);
        client.ask(STOP, json!({})).await;
    });
}

// ---- others ---------------------------------------------------------------------------------------------------------

/// Three ways to lose a goal to somebody else; each shows, and the trial waits.
#[test]
fn a_trial_whose_goal_is_preempted_by_somebody_else_shows_that_and_waits() {
    in_virtual_time(async {
        for (service, args) in [
            (SEND, json!({"x": 1, "y": 1, "success_hold": 0.2})),
            (CANCEL, json!({})),
            ("/arm_sim/reset", json!({})),
        ] {
            let (stage, mut client) = floating_and_watched().await;
            client.ask(START, hard(60.0)).await;
            let before = status(&mut client).await;
            assert_eq!(before["action_status"], "active");
            client.heard.clear();
            let mut other = stage.connect();
            other.ask(service, args).await;
            for after in client.messages_for(ms(2000), STATUS).await {
                assert_eq!(after["running"], true);
                assert_eq!(after["action_status"], "preempted");
                assert_eq!(after["target"], before["target"]);
                assert_eq!(after["error"], Value::Null);
                assert_eq!(after["desired_positions"], Value::Null);
            }
            assert_eq!(client.messages(RESULT).len(), 1);
        }
    });
}

#[test]
fn a_trial_that_waits_goes_on_with_skip_and_anew_with_start_and_ends_with_stop_or_by_itself() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, hard(5.0)).await;
        client.ask(CANCEL, json!({})).await;
        assert_eq!(status(&mut client).await["action_status"], "preempted");
        client.ask(SKIP, json!({})).await;
        assert_eq!(status(&mut client).await["action_status"], "active");
        client.ask(CANCEL, json!({})).await;
        client.ask(START, json!({})).await;
        let afresh = status(&mut client).await;
        assert_eq!(afresh["action_status"], "active");
        assert!(number(&afresh["elapsed"]) < 0.11);
        client.ask(CANCEL, json!({})).await;
        client.ask(STOP, json!({})).await;
        assert_nothing_in_flight(&status(&mut client).await);
        client.ask(START, json!({})).await;
        client.ask(CANCEL, json!({})).await;
        client.messages_for(ms(5000), STATUS).await;
        let end = status(&mut client).await;
        assert_eq!(end["running"], false);
        assert_nothing_in_flight(&end);
    });
}

/// A trial that ends must not take somebody else's goal with it.
#[test]
fn a_trial_cancels_no_goal_but_its_own() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        let mut other = stage.connect();
        for end in [STOP, SKIP, START] {
            client.ask(START, hard(60.0)).await;
            let goal_id = other.send_goal(json!({"x": 1, "y": 1})).await;
            client.settle().await;
            client.heard.clear();
            client.ask(end, json!({})).await;
            let theirs: Vec<Value> = client.messages(RESULT);
            if end == STOP {
                assert!(theirs.is_empty());
                other.ask(CANCEL, json!({"goal_id": goal_id})).await;
            } else {
                // A new target of the trial preempts any goal, as one of anybody else would.
                assert_eq!(theirs.len(), 1);
                assert_eq!(theirs[0]["goal_id"], goal_id);
            }
        }
    });
}

#[test]
fn trials_outlive_the_client_that_started_them() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        let mut other = stage.connect();
        other.ask(START, easy(2.0, 0.1)).await;
        drop(other);
        client.messages_for(ms(2100), STATUS).await;
        let end = client.messages(STATUS).pop().unwrap();
        assert_eq!(end["running"], false);
        assert!(number(&end["targets_reached"]) > 10.0);
    });
}

// ---- status ---------------------------------------------------------------------------------------------------------

#[test]
fn status_shows_the_trial_and_the_goal_that_it_tracks() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.subscribe("/ik_action/feedback").await;
        client.ask(START, hard(60.0)).await;
        let status = status(&mut client).await;
        assert_eq!(status.as_object().unwrap().len(), 8);
        assert_eq!(status["running"], true);
        assert_eq!(status["duration"], 60.0);
        assert_eq!(status["targets_reached"], 0);
        assert_eq!(status["action_status"], "active");
        assert_eq!(status["target"].as_object().unwrap().len(), 2);
        let feedback = client.messages("/ik_action/feedback").pop().unwrap();
        assert_eq!(status["target"], feedback["target"]);
        assert_eq!(status["desired_positions"], feedback["positions"]);
        // The arm floats: the distance is the same at all times.
        assert_eq!(status["error"], feedback["distance_remaining"]);
    });
}

#[test]
fn status_comes_at_10_hz_from_the_first_start_on_also_when_the_trial_is_over_or_the_arm_paused() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        let before = client.messages_for(ms(1000), STATUS).await;
        assert!(before.is_empty(), "no trial exists yet");
        client.ask(START, hard(60.0)).await;
        // What changes at the start is reported at once; from then on nothing does.
        client.messages_for(ms(50), STATUS).await;
        for _ in 0..3 {
            let statuses = client.messages_for(ms(2000), STATUS).await;
            assert_eq!(statuses.len(), 20);
            for pair in statuses.windows(2) {
                let gap = number(&pair[1]["elapsed"]) - number(&pair[0]["elapsed"]);
                assert!((gap - 0.1).abs() < ROUNDING, "the clock is the present one");
            }
        }
        client.ask("/arm_sim/pause", json!({"data": true})).await;
        assert_eq!(client.messages_for(ms(2000), STATUS).await.len(), 20);
        client.ask(STOP, json!({})).await;
        client.messages_for(ms(1), STATUS).await;
        assert_eq!(client.messages_for(ms(2000), STATUS).await.len(), 20);
    });
}

#[test]
fn status_comes_at_every_change_too() {
    in_virtual_time(async {
        let (_stage, mut client) = floating_and_watched().await;
        client.ask(START, easy(10.0, 0.04)).await;
        client.messages_for(ms(60), STATUS).await;
        client.ask(SKIP, json!({})).await;
        client.ask(CANCEL, json!({})).await;
        client.ask(STOP, json!({})).await;
        client.messages_for(ms(1), STATUS).await;
        let story: Vec<String> = client
            .messages(STATUS)
            .iter()
            .map(|status| {
                let (running, count) = (&status["running"], &status["targets_reached"]);
                format!(
                    "{running} {count} {}",
                    status["action_status"].as_str().unwrap()
                )
            })
            .collect();
        assert_eq!(
            story,
            [
                "true 0 idle",
                "true 0 active",
                "true 1 reached",
                "true 1 active",
                "true 1 idle",
                "true 1 active",
                "true 1 preempted",
                "false 1 idle",
            ]
        );
    });
}

#[test]
fn status_goes_to_whoever_subscribes_while_they_do() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.ask(START, hard(60.0)).await;
        pass(ms(1000)).await;
        client.subscribe(STATUS).await;
        assert_eq!(client.messages_for(ms(1050), STATUS).await.len(), 10);
        let mut other = stage.connect();
        other.subscribe(STATUS).await;
        client.unsubscribe(STATUS).await;
        client.heard.clear();
        assert!(client.messages_for(ms(500), STATUS).await.is_empty());
        assert!(!other.messages_for(ms(500), STATUS).await.is_empty());
    });
}

// ---- idleness -------------------------------------------------------------------------------------------------------

/// An arm that says nothing unless it is asked, and makes no steps.
struct SilentArm;

impl Actor for SilentArm {
    type Context = Context<Self>;
}

impl Handler<ArmPose<2>> for SilentArm {
    type Result = Pose<2>;

    fn handle(&mut self, _: ArmPose<2>, _: &mut Context<Self>) -> Pose<2> {
        Pose {
            lengths: [1.0, 1.0],
            positions: [0.0, 0.0],
            simulated: 0.0,
        }
    }
}

impl Handler<TrackGoal<2>> for SilentArm {
    type Result = Tracking<2>;

    fn handle(&mut self, goal: TrackGoal<2>, _: &mut Context<Self>) -> Tracking<2> {
        Tracking {
            positions: goal.solution,
            before: None,
        }
    }
}

impl Handler<EndGoal<2>> for SilentArm {
    type Result = Option<GoalJudged<2>>;

    fn handle(&mut self, _: EndGoal<2>, _: &mut Context<Self>) -> Self::Result {
        None
    }
}

/// In an hour the machinery of virtual time itself wakes the thread a few times; a status at 10 Hz wakes it 36,000 times.
#[test]
fn nothing_ticks_while_no_goal_is_active_no_trial_runs_and_nobody_watches() {
    counting_wake_ups(|sleeps| async move {
        let gauges = std::sync::Arc::default();
        let registry = Registry::new(std::sync::Arc::clone(&gauges)).start();
        let mut nodes = Nodes::default();
        let arm = SilentArm.start();
        let tracker = GoalTracker {
            track: arm.clone().recipient(),
            end: arm.clone().recipient(),
        };
        stage::start_goal_nodes::<2>(&registry, arm.recipient(), tracker, 1, &mut nodes);
        registry.send(Attach(nodes)).await.unwrap();
        let mut client = connect(&registry, &gauges);
        let mut other = connect(&registry, &gauges);
        client.ask("/ik/solve", json!({"x": 1, "y": 1})).await;
        let an_hour = || async {
            let before = sleeps.load(Ordering::Relaxed);
            pass(ms(3_600_000)).await;
            sleeps.load(Ordering::Relaxed) - before
        };
        let quiet = 0..100;

        assert!(quiet.contains(&an_hour().await), "at first");
        client.send_goal(json!({"x": 1, "y": 1})).await;
        assert!(quiet.contains(&an_hour().await), "the arm is silent");
        client.ask(START, hard(1e9)).await;
        assert!(quiet.contains(&an_hour().await), "a trial, unwatched");
        client.ask(STOP, json!({})).await;
        assert!(quiet.contains(&an_hour().await), "after the trial");
        other.subscribe(STATUS).await;
        let listening = async { other.messages_for(ms(3_600_000), STATUS).await.len() };
        let (awake, heard) = tokio::join!(an_hour(), listening);
        assert!(awake >= 36_000 && heard >= 35_999, "{awake}, {heard}");
        drop(other);
        pass(ms(1000)).await;
        assert!(quiet.contains(&an_hour().await), "the watcher is gone");
    });
}
