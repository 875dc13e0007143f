//! Goals from end to end, in virtual time: what is accepted, what is said in which order, and when a goal is reached,
//! counted in steps.
//!
//! Many of these tests let the arm float: without gravity, and with the controller off, it stays at q = 0, the hand of
//! two links of 1 m at exactly (2, 0). A goal there has been reached on time if it has been reached to the step.

mod stage;

use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::arm_sim::{GoalJudged, TrackGoal};
use pendularm::actors::node::TopicMessage;
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::forward;
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use stage::{Client, Stage, in_virtual_time, ms, number, numbers, pass};
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};

const FEEDBACK: &str = "/ik_action/feedback";
const RESULT: &str = "/ik_action/result";
const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";

/// One step of the default timestep \[s\].
const STEP: f64 = 0.001;
/// Simulation times are differences of products of steps and timestep: a few units in the last place of 100 s.
const ROUNDING: f64 = 1e-12;

/// A goal where the floating arm's hand is, held so long \[s\].
fn here(success_hold: f64) -> Value {
    json!({"x": 2, "y": 0, "epsilon": 0.1, "success_hold": success_hold})
}

/// A goal that the floating arm does not come near.
fn elsewhere() -> Value {
    json!({"x": 1, "y": 1})
}

fn call(service: &str, args: &Value) -> Value {
    json!({"op": "call_service", "service": service, "args": args})
}

// ---- accepting ------------------------------------------------------------------------------------------------------

#[test]
fn a_goal_is_answered_with_its_id_and_then_its_trajectory_goes_out() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe("/joint_trajectory").await;
        client.heard.clear();
        let values = client.ask(SEND, json!({"x": 1, "y": 1})).await;
        assert_eq!(values.as_object().unwrap().len(), 1);
        assert!(values["goal_id"].is_string());
        let trajectory = client.message("/joint_trajectory").await;
        assert_eq!(client.story(), [SEND, "/joint_trajectory"]);
        assert_eq!(trajectory["joint_names"], json!(["joint1", "joint2"]));
        assert_eq!(trajectory["points"].as_array().unwrap().len(), 1);
        assert_eq!(trajectory["points"][0]["velocities"], json!([0.0, 0.0]));
        let positions = numbers(&trajectory["points"][0]["positions"]);
        let hand = forward(&[1.0, 1.0], &[positions[0], positions[1]]).position;
        // A closed form loses a few units in the last place.
        assert!((hand - glam::DVec2::ONE).length() < 1e-14);
        client.settle().await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, positions[..], "bit for bit, over JSON");
        assert_eq!(setpoint.velocity, [0.0, 0.0]);
    });
}

#[test]
fn goal_ids_are_unique() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let mut ids = std::collections::BTreeSet::new();
        for _ in 0..100 {
            assert!(ids.insert(client.send_goal(elsewhere()).await));
            client.refusal(SEND, json!({"x": 5, "y": 5})).await;
        }
    });
}

#[test]
fn sending_a_goal_never_enables_the_controller() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.send_goal(elsewhere()).await;
        pass(ms(1000)).await;
        let simulation = stage.simulation().await;
        assert!(!simulation.pid().is_enabled());
        assert_eq!(simulation.effort(), &[0.0, 0.0]);
        assert_eq!(simulation.state().position, [0.0, 0.0]);
    });
}

#[test]
fn every_bad_field_is_named_and_the_values_are_empty() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        let response = client
            .call(
                SEND,
                json!({"x": "1", "phi": [], "epsilon": 0, "success_hold": -1}),
            )
            .await;
        assert_eq!(response["result"], false);
        assert_eq!(response["values"], json!({}));
        let why = response["status"].as_str().unwrap();
        for sentence in [
            "x must be a number",
            "y is required",
            "phi must be a number",
            "epsilon must be greater than 0, got 0",
            "success_hold must be at least 0, got -1",
        ] {
            assert!(why.contains(sentence), "{why}");
        }
    });
}

#[test]
fn null_in_an_optional_field_means_absent() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client
            .send_goal(json!({"x": 1, "y": 1, "phi": null, "epsilon": null, "success_hold": null}))
            .await;
        client.ask(CANCEL, json!({})).await;
        let result = &client.messages(RESULT)[0];
        assert_eq!(result["target"], json!({"x": 1.0, "y": 1.0}));
        client.refusal(SEND, json!({"x": null, "y": 1})).await;
    });
}

#[test]
fn the_target_echoes_x_and_y_and_phi_where_one_was_asked_for() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client
            .send_goal(json!({"x": 1, "y": 0.5, "phi": 0.75}))
            .await;
        client.send_goal(json!({"x": 1, "y": 0.5})).await;
        client.ask(CANCEL, json!({})).await;
        let targets: Vec<Value> = client
            .messages(RESULT)
            .iter()
            .map(|result| result["target"].clone())
            .collect();
        assert_eq!(
            targets,
            [
                json!({"x": 1.0, "y": 0.5, "phi": 0.75}),
                json!({"x": 1.0, "y": 0.5})
            ]
        );
    });
}

#[test]
fn two_links_ignore_phi_in_a_goal_too() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client
            .send_goal(json!({"x": 1, "y": 0.5, "phi": "north"}))
            .await;
        client.ask(CANCEL, json!({})).await;
        let result = &client.messages(RESULT)[0];
        assert_eq!(result["target"], json!({"x": 1.0, "y": 0.5}));
    });
}

/// An arm that has wound up by two turns and more gets there without unwinding.
#[test]
fn a_goals_joints_are_within_pi_of_the_present_positions() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe("/joint_trajectory").await;
        client.enable().await;
        client.publish_trajectory(json!([14.0, -9.0])).await;
        pass(ms(8000)).await;
        client.heard.clear();
        for (x, y) in [(1.0, 1.0), (-1.5, 0.1), (-1.5, -0.1), (0.0, -0.5)] {
            let present = stage.simulation().await.state().position;
            assert!(present[0] > 9.0 && present[1] < -5.0, "{present:?}");
            client.send_goal(json!({"x": x, "y": y})).await;
            let trajectory = client.message("/joint_trajectory").await;
            let positions = numbers(&trajectory["points"][0]["positions"]);
            for (joint, present) in positions.iter().zip(present) {
                assert!((joint - present).abs() <= std::f64::consts::PI);
            }
        }
    });
}

#[test]
fn a_rejected_goal_changes_nothing() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        client.subscribe("/joint_trajectory").await;
        let goal_id = client.send_goal(elsewhere()).await;
        client.message("/joint_trajectory").await;
        client.settle().await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        client.heard.clear();
        for args in [
            json!({"x": 2.1, "y": 0}),
            json!({"x": 1}),
            json!({"x": 1, "y": 0, "epsilon": -1}),
            json!({"x": 1, "y": 0, "success_hold": "long"}),
        ] {
            client.refusal(SEND, args).await;
        }
        let feedback = client.messages_for(ms(500), FEEDBACK).await;
        assert!(feedback.iter().all(|message| message["goal_id"] == goal_id));
        // Its clock went on from where it was: no new goal under the old name.
        assert!(number(&feedback.last().unwrap()["elapsed"]) > 0.4);
        assert!(client.messages("/joint_trajectory").is_empty());
        assert!(client.messages(RESULT).is_empty());
        assert_eq!(*stage.simulation().await.pid().setpoint(), setpoint);
    });
}

// ---- reaching -------------------------------------------------------------------------------------------------------

/// The first step ends 1 ms after the start and finds the hand there; it must have stayed 0.25 s since.
#[test]
fn a_goal_is_reached_at_the_very_step_that_completes_the_dwell() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        let goal_id = client.send_goal(here(0.25)).await;
        let result = client.message(RESULT).await;
        assert_eq!(
            result,
            json!({"goal_id": goal_id, "outcome": "reached",
                "target": {"x": 2.0, "y": 0.0}, "final_distance": 0.0})
        );
        let last = client.messages(FEEDBACK).pop().unwrap();
        // Feedback comes 60 times a second: the last one before 0.251 s is at most 1/60 s older.
        let elapsed = number(&last["elapsed"]);
        assert!((0.251 - 1.0 / 60.0..=0.251).contains(&elapsed), "{elapsed}");
    });
}

/// The arm is looked at between two wake-ups: after 250 steps the goal is active, after 251 it is not.
#[test]
fn not_a_step_earlier_and_not_a_step_later() {
    in_virtual_time(async {
        for (wait, reached) in [(250, false), (251, true)] {
            let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
            client.subscribe(RESULT).await;
            client.send_goal(here(0.25)).await;
            pass(ms(wait)).await;
            let cancelled = client.call(CANCEL, json!({})).await["result"] == true;
            assert_eq!(cancelled, !reached);
            let outcome = if reached { "reached" } else { "preempted" };
            assert_eq!(client.messages(RESULT)[0]["outcome"], outcome);
        }
    });
}

/// Even there the order stands: response, trajectory, feedback, result.
#[test]
fn a_success_hold_of_0_is_content_with_the_first_step_after_response_and_trajectory() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        client.heard.clear();
        let goal = client.send_goal(here(0.0)).await;
        client.messages_for(ms(100), RESULT).await;
        let expected = [
            SEND.to_owned(),
            "/joint_trajectory".to_owned(),
            format!("{FEEDBACK} {goal}"),
            format!("{RESULT} {goal} reached"),
        ];
        assert_eq!(client.story(), expected);
        let elapsed = number(&client.messages(FEEDBACK)[0]["elapsed"]);
        assert!((elapsed - STEP).abs() < ROUNDING);
    });
}

/// The hand leaves epsilon for 20 ms, because the first link is longer for so long; the 250 ms count from its return.
#[test]
fn any_excursion_starts_the_dwell_over_and_new_lengths_count_at_once() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        client.send_goal(here(0.25)).await;
        pass(ms(200)).await;
        let set_params = "/arm_sim/set_params";
        client.ask(set_params, json!({"lengths": [1.5, 1.0]})).await;
        let away = client.messages_for(ms(20), FEEDBACK).await;
        let distances: Vec<f64> = away
            .iter()
            .map(|message| number(&message["distance_remaining"]))
            .collect();
        assert_eq!(distances, [0.5], "one report falls into 20 ms");
        client.ask(set_params, json!({"lengths": [1.0, 1.0]})).await;
        pass(ms(250)).await;
        // Since the return 250 steps were made, the first of which found the hand there: one is lacking.
        client.settle().await;
        assert!(client.messages(RESULT).is_empty());
        pass(ms(1)).await;
        client.settle().await;
        client.messages_for(ms(20), RESULT).await;
        assert_eq!(client.messages(RESULT)[0]["outcome"], "reached");
        assert_eq!(
            client.messages("/joint_trajectory").len(),
            1,
            "the goal is not solved again"
        );
    });
}

#[test]
fn pausing_pauses_the_dwell_and_the_feedback() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        client.send_goal(here(0.25)).await;
        pass(ms(200)).await;
        let pause = "/arm_sim/pause";
        client.ask(pause, json!({"data": true})).await;
        client.heard.clear();
        let meanwhile = client.messages_for(ms(10_000), FEEDBACK).await;
        assert_eq!(meanwhile, [] as [Value; 0]);
        client.ask(pause, json!({"data": false})).await;
        pass(ms(50)).await;
        client.settle().await;
        assert!(client.messages(RESULT).is_empty(), "250 steps");
        pass(ms(1)).await;
        client.settle().await;
        client.messages_for(ms(1), RESULT).await;
        assert_eq!(client.messages(RESULT).len(), 1, "251 steps");
    });
}

/// By default the hand must be within 2 cm for half a second; on an arm that moves the two goals go exactly alike.
#[test]
fn epsilon_is_2_cm_and_success_hold_half_a_second_where_none_is_given() {
    in_virtual_time(async {
        let mut runs = Vec::new();
        for args in [
            json!({"x": 1, "y": 1}),
            json!({"x": 1, "y": 1, "epsilon": 0.02, "success_hold": 0.5}),
            json!({"x": 1, "y": 1, "epsilon": 0.019}),
            json!({"x": 1, "y": 1, "success_hold": 0.501}),
        ] {
            let stage = Stage::<2>::start().await;
            let mut client = stage.connect();
            client.enable().await;
            client.subscribe(RESULT).await;
            client.subscribe(FEEDBACK).await;
            client.send_goal(args).await;
            let result = client.message(RESULT).await;
            assert_eq!(result["outcome"], "reached");
            let feedback = client.messages(FEEDBACK);
            let last_second = |message: &&Value| {
                number(&feedback.last().unwrap()["elapsed"]) - number(&message["elapsed"]) < 0.5
            };
            assert!(feedback.iter().filter(last_second).count() >= 29);
            for message in feedback.iter().filter(last_second) {
                assert!(number(&message["distance_remaining"]) <= 0.02);
            }
            runs.push((result, feedback));
        }
        assert_eq!(runs[0], runs[1]);
        assert_ne!(runs[0], runs[2]);
        assert_ne!(runs[0], runs[3]);
    });
}

#[test]
fn distance_is_that_of_the_position_whatever_the_orientation() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        // The hand is at (3, 0) and points along 0.
        client
            .send_goal(json!({"x": 2.9, "y": 0, "phi": 0.3, "epsilon": 0.11, "success_hold": 0.1}))
            .await;
        let result = client.message(RESULT).await;
        assert_eq!(result["outcome"], "reached");
        assert!((number(&result["final_distance"]) - 0.1).abs() < ROUNDING);
    });
}

// ---- feedback -------------------------------------------------------------------------------------------------------

#[test]
fn feedback_tells_goal_target_setpoint_distance_and_time() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        client.subscribe("/joint_trajectory").await;
        let goal_id = client.send_goal(elsewhere()).await;
        let trajectory = client.message("/joint_trajectory").await;
        let feedback = client.message(FEEDBACK).await;
        assert_eq!(feedback.as_object().unwrap().len(), 5);
        assert_eq!(feedback["goal_id"], goal_id);
        assert_eq!(feedback["target"], json!({"x": 1.0, "y": 1.0}));
        assert_eq!(feedback["positions"], trajectory["points"][0]["positions"]);
        let distance = number(&feedback["distance_remaining"]);
        assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
        assert!((number(&feedback["elapsed"]) - STEP).abs() < ROUNDING);
    });
}

/// After 1 ms, then in every sixtieth of a second that follows: 120 in two seconds.
#[test]
fn feedback_comes_60_times_per_second_of_simulation_progress() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        client.send_goal(elsewhere()).await;
        client.messages_for(ms(2000), FEEDBACK).await;
        client.settle().await;
        assert_eq!(client.messages(FEEDBACK).len(), 120);
        let elapsed: Vec<f64> = client
            .messages(FEEDBACK)
            .iter()
            .map(|message| number(&message["elapsed"]))
            .collect();
        for pair in elapsed.windows(2) {
            // The first step of each period: 16 or 17 steps apart.
            let gap = (pair[1] - pair[0]) / STEP;
            assert!((15.9..17.1).contains(&gap), "{gap}");
        }
    });
}

#[test]
fn where_steps_are_longer_there_is_one_feedback_per_step() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client
            .ask("/arm_sim/set_integrator", json!({"timestep": 0.1}))
            .await;
        client.subscribe(FEEDBACK).await;
        client.send_goal(elsewhere()).await;
        client.messages_for(ms(2010), FEEDBACK).await;
        assert_eq!(client.messages(FEEDBACK).len(), 20);
    });
}

#[test]
fn without_an_active_goal_there_is_no_feedback() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        let before = client.messages_for(ms(1000), FEEDBACK).await;
        assert!(before.is_empty());
        client.send_goal(elsewhere()).await;
        pass(ms(200)).await;
        client.ask(CANCEL, json!({})).await;
        client.heard.clear();
        let after = client.messages_for(ms(1000), FEEDBACK).await;
        assert!(after.is_empty());
    });
}

#[test]
fn a_trajectory_from_somebody_else_moves_the_setpoint_and_nothing_of_the_goal() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        client.subscribe(RESULT).await;
        let goal_id = client.send_goal(elsewhere()).await;
        let before = client.message(FEEDBACK).await;
        stage.connect().publish_trajectory(json!([0.25, 0.5])).await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.25, 0.5]);
        client.heard.clear();
        let after = client.messages_for(ms(500), FEEDBACK).await.pop().unwrap();
        assert_eq!(after["goal_id"], goal_id);
        assert_eq!(after["positions"], before["positions"]);
        assert!(client.messages(RESULT).is_empty());
        client.ask(CANCEL, json!({"goal_id": goal_id})).await;
    });
}

// ---- preempting -----------------------------------------------------------------------------------------------------

/// Also with a `success_hold` of 0 the new goal's feedback and result come last.
#[test]
fn a_preempting_goal_comes_after_the_old_result_and_before_its_own_trajectory() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        let old = client.send_goal(elsewhere()).await;
        // Between two feedback messages.
        client.messages_for(ms(105), RESULT).await;
        client.heard.clear();
        let new = client.send_goal(here(0.0)).await;
        client.messages_for(ms(100), RESULT).await;
        let expected = [
            format!("{RESULT} {old} preempted"),
            SEND.to_owned(),
            "/joint_trajectory".to_owned(),
            format!("{FEEDBACK} {new}"),
            format!("{RESULT} {new} reached"),
        ];
        assert_eq!(client.story(), expected);
        let old = &client.messages(RESULT)[0];
        // The hand is at (2, 0), the old target at (1, 1).
        let distance = number(&old["final_distance"]);
        assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
    });
}

/// 253 ms after its start the old goal has been reached, but the arm finds that out only now, on being asked for the
/// new goal: the word of it and the new goal cross on their way.
#[test]
fn a_goal_reached_in_the_instant_of_the_next_has_one_result_and_it_says_reached() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for _ in 0..10 {
            let old = client.send_goal(here(0.25)).await;
            pass(ms(253)).await;
            client.heard.clear();
            client.send_goal(elsewhere()).await;
            let expected = [format!("{RESULT} {old} reached"), SEND.to_owned()];
            assert_eq!(client.story(), expected);
            let more = client.messages_for(ms(100), RESULT).await;
            assert!(more.is_empty());
        }
    });
}

#[test]
fn every_goal_has_exactly_one_result() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let mut other = stage.connect();
        let mut sent = Vec::new();
        // Goals of two clients, some reached, some replaced, some cancelled, some lost to a reset.
        for round in 0_u64..60 {
            sent.push(client.send_goal(here(0.02)).await);
            pass(ms(round % 31)).await;
            match round % 4 {
                0 => sent.push(other.send_goal(elsewhere()).await),
                1 => {
                    other.call(CANCEL, json!({})).await;
                }
                2 => {
                    other.ask("/arm_sim/reset", json!({})).await;
                }
                _ => {}
            }
        }
        client.call(CANCEL, json!({})).await;
        client.messages_for(ms(1000), RESULT).await;
        let results = client.messages(RESULT);
        let mut ended: Vec<&str> = results
            .iter()
            .map(|result| result["goal_id"].as_str().unwrap())
            .collect();
        assert!(results.iter().any(|result| result["outcome"] == "reached"));
        assert!(
            results
                .iter()
                .any(|result| result["outcome"] == "preempted")
        );
        assert_eq!(ended, sent, "in the order in which they were sent");
        ended.dedup();
        assert_eq!(ended.len(), sent.len());
    });
}

#[test]
fn what_one_connection_sends_takes_effect_in_order_without_waiting_for_answers() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.heard.clear();
        for frame in [
            call(SEND, &elsewhere()),
            call(SEND, &here(5.0)),
            call(CANCEL, &json!({})),
            call(CANCEL, &json!({})),
            call(SEND, &elsewhere()),
            call("/arm_sim/reset", &json!({})),
            call(CANCEL, &json!({})),
        ] {
            client.send(&frame).await;
        }
        client.messages_for(ms(100), RESULT).await;
        let expected = [
            SEND.to_owned(),
            format!("{RESULT} goal-1 preempted"),
            SEND.to_owned(),
            format!("{RESULT} goal-2 preempted"),
            CANCEL.to_owned(),
            CANCEL.to_owned(),
            SEND.to_owned(),
            format!("{RESULT} goal-3 preempted"),
            "/arm_sim/reset".to_owned(),
            CANCEL.to_owned(),
        ];
        assert_eq!(client.story(), expected);
        let cancelled: Vec<&Value> = client
            .heard
            .iter()
            .filter(|frame| frame["service"] == CANCEL)
            .map(|frame| &frame["result"])
            .collect();
        assert_eq!(cancelled, [true, false, false]);
    });
}

// ---- cancelling -----------------------------------------------------------------------------------------------------

#[test]
fn cancelling_publishes_the_result_and_then_answers_with_nothing() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for named in [false, true] {
            let goal_id = client.send_goal(elsewhere()).await;
            client.heard.clear();
            let args = if named {
                json!({"goal_id": goal_id})
            } else {
                json!({})
            };
            assert_eq!(client.ask(CANCEL, args).await, json!({}));
            let expected = [format!("{RESULT} {goal_id} preempted"), CANCEL.to_owned()];
            assert_eq!(client.story(), expected);
        }
    });
}

#[test]
fn cancelling_without_an_active_goal_is_rejected() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        assert_eq!(client.refusal(CANCEL, json!({})).await, "no goal is active");
        let goal_id = client.send_goal(elsewhere()).await;
        client.ask(CANCEL, json!({})).await;
        let again = client.refusal(CANCEL, json!({"goal_id": goal_id})).await;
        assert_eq!(again, "no goal is active");
    });
}

#[test]
fn cancelling_another_goal_or_a_malformed_id_is_rejected_without_side_effects() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let old = client.send_goal(elsewhere()).await;
        let active = client.send_goal(elsewhere()).await;
        client.heard.clear();
        for goal_id in [
            json!(old),
            json!(""),
            json!(7),
            json!(null),
            json!([active]),
        ] {
            let response = client.call(CANCEL, json!({"goal_id": goal_id})).await;
            assert_eq!(response["result"], false);
            assert_eq!(response["values"], json!({}));
            let why = response["status"].as_str().unwrap();
            assert!(why.starts_with("goal_id "), "{why}");
        }
        assert!(client.messages(RESULT).is_empty());
        client.ask(CANCEL, json!({"goal_id": active})).await;
    });
}

#[test]
fn goals_outlive_the_client_that_made_them() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let mut other = stage.connect();
        let goal_id = other.send_goal(here(1.0)).await;
        drop(other);
        let result = client.message(RESULT).await;
        assert_eq!(result["goal_id"], goal_id);
        assert_eq!(result["outcome"], "reached");
    });
}

// ---- reset and divergence -------------------------------------------------------------------------------------------

#[test]
fn a_reset_preempts_the_goal_before_it_is_answered() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        for paused in [false, true] {
            client.ask("/arm_sim/pause", json!({"data": paused})).await;
            let goal_id = client.send_goal(elsewhere()).await;
            client.settle().await;
            client.heard.clear();
            let pose = client.ask("/arm_sim/reset", json!({})).await;
            assert_eq!(
                pose,
                json!({"position": [0.0, 0.0], "velocity": [0.0, 0.0]})
            );
            let expected = [
                format!("{RESULT} {goal_id} preempted"),
                "/arm_sim/reset".to_owned(),
            ];
            assert_eq!(client.story(), expected);
            let distance = number(&client.messages(RESULT)[0]["final_distance"]);
            assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
            client.heard.clear();
            let later = client.messages_for(ms(500), FEEDBACK).await;
            assert!(later.is_empty(), "no goal is left to report on");
            let setpoint = *stage.simulation().await.pid().setpoint();
            assert_eq!(setpoint.position, [0.0, 0.0]);
        }
    });
}

/// Hears of a goal in a goal's owner's place.
struct Owner(UnboundedSender<GoalJudged<2>>);

impl Actor for Owner {
    type Context = Context<Self>;
}

impl Handler<GoalJudged<2>> for Owner {
    type Result = ();

    fn handle(&mut self, judged: GoalJudged<2>, _: &mut Context<Self>) {
        self.0.send(judged).unwrap();
    }
}

/// Between the announcement of a goal and its trajectory another client's reset may come. Then the reset counts as the
/// later of the two, and the trajectory must not pull the arm out of its starting pose.
#[test]
fn a_reset_that_overtakes_a_goals_trajectory_makes_it_void() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        let (sender, mut news) = unbounded_channel();
        let owner = Owner(sender).start();
        let announce = |number| {
            stage.arm.send(TrackGoal {
                number,
                target: glam::DVec2::ONE,
                criteria: Criteria::default(),
                solution: [0.0, 1.5],
                owner: owner.clone().recipient(),
            })
        };
        let trajectory = || TopicMessage {
            msg: to_raw_value(&json!({"points": [{"positions": [0.0, 1.5]}]})).unwrap(),
            sender: None,
        };
        announce(1).await.unwrap();
        client.ask("/arm_sim/reset", json!({})).await;
        assert_eq!(news.recv().await.unwrap().outcome, Some(Outcome::Preempted));
        stage.arm.send(trajectory()).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 0.0]);
        // The next goal is none the worse for it.
        announce(2).await.unwrap();
        stage.arm.send(trajectory()).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 1.5]);
        assert_eq!(news.recv().await.unwrap().number, 2);
    });
}

#[test]
fn a_goal_is_not_judged_before_its_trajectory_has_come() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        let (sender, mut news) = unbounded_channel();
        let tracking = stage
            .arm
            .send(TrackGoal {
                number: 1,
                target: glam::dvec2(2.0, 0.0),
                criteria: Criteria {
                    epsilon: 0.1,
                    success_hold: 0.0,
                },
                solution: [0.0, 0.0],
                owner: Owner(sender).start().recipient(),
            })
            .await
            .unwrap();
        assert_eq!(tracking.positions, [0.0, 0.0]);
        pass(ms(100)).await;
        assert!(news.try_recv().is_err());
        let msg = to_raw_value(&json!({"points": [{"positions": [0.0, 0.0]}]})).unwrap();
        stage.arm.do_send(TopicMessage { msg, sender: None });
        let first = news.recv().await.unwrap();
        assert!((first.elapsed - STEP).abs() < ROUNDING);
    });
}

/// Euler with a timestep of half a second, at the default gains: each step multiplies the error by more than 100.
async fn diverge(stage: &Stage<2>, client: &mut Client) {
    client
        .ask(
            "/arm_sim/set_integrator",
            json!({"method": "euler", "timestep": 0.5}),
        )
        .await;
    client.enable().await;
    while stage.simulation().await.divergence().is_none() {
        pass(ms(500)).await;
    }
}

#[test]
fn while_diverged_a_goal_stays_active_until_the_reset() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        let goal_id = client.send_goal(elsewhere()).await;
        diverge(&stage, &mut client).await;
        client.settle().await;
        client.heard.clear();
        let meanwhile = client.messages_for(Duration::from_secs(60), FEEDBACK);
        assert!(meanwhile.await.is_empty(), "its clock stands");
        assert!(client.messages(RESULT).is_empty());
        // A goal that comes now is taken, and as active.
        let later = client.send_goal(elsewhere()).await;
        assert_eq!(client.messages(RESULT)[0]["goal_id"], goal_id);
        client.ask("/arm_sim/reset", json!({})).await;
        assert_eq!(client.messages(RESULT)[1]["goal_id"], later);
        assert_eq!(client.messages(RESULT)[1]["outcome"], "preempted");
    });
}

// ---- subscribers ----------------------------------------------------------------------------------------------------

/// A late subscriber hears from then on; nothing is kept for it.
#[test]
fn feedback_goes_to_whoever_subscribes_and_stops_with_the_subscription() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.send_goal(elsewhere()).await;
        pass(ms(1000)).await;
        let mut other = stage.connect();
        other.subscribe(FEEDBACK).await;
        let first = other.message(FEEDBACK).await;
        assert!(number(&first["elapsed"]) > 1.0 - STEP);
        other.unsubscribe(FEEDBACK).await;
        other.heard.clear();
        let after = other.messages_for(ms(500), FEEDBACK).await;
        assert!(after.is_empty());
    });
}

#[test]
fn clients_can_neither_publish_nor_advertise_feedback_and_result() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [FEEDBACK, RESULT, "/ik_trial/status"] {
            for op in ["advertise", "publish"] {
                client
                    .send(&json!({"op": op, "topic": topic, "msg": {}}))
                    .await;
                let status = client.next_where(|frame| frame["op"] == "status").await;
                assert_eq!(status["level"], "error");
            }
        }
    });
}
