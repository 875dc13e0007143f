//! When a goal counts as reached, to the step.

use super::*;

/// The first step ends 1 ms after the start and finds the end effector there; it must have stayed 0.25 s since.
#[test]
fn a_goal_is_reached_at_the_very_step_that_completes_the_dwell() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        let goal_id = stage.send_goal(here(0.25)).await;
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

/// The end effector leaves epsilon for 20 ms, because the first link is longer for so long; the 250 ms count from its return.
#[test]
fn any_excursion_starts_the_dwell_over_and_new_lengths_count_at_once() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        stage.send_goal(here(0.25)).await;
        pass(ms(200)).await;
        stage.set_lengths([1.5, 1.0]).await;
        client.settle().await;
        let away = client.messages_for(ms(20), FEEDBACK).await;
        let distances: Vec<f64> = away
            .iter()
            .map(|message| number(&message["distance_remaining"]))
            .collect();
        assert_eq!(distances, [0.5], "one report falls into 20 ms");
        stage.set_lengths([1.0, 1.0]).await;
        pass(ms(250)).await;
        // Since the return 250 steps were made, the first of which found the end effector there: one is lacking.
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

/// By default the end effector must be within 2 cm for half a second; on an arm that moves the two goals go exactly alike.
#[test]
fn epsilon_is_2_cm_and_success_hold_half_a_second_where_none_is_given() {
    in_virtual_time(async {
        let mut runs = Vec::new();
        // The defaults are the adapter's: a node says what it wants.
        for args in [
            json!({"x": 1, "y": 1}),
            json!({"x": 1, "y": 1, "epsilon": 0.02, "success_hold": 0.5}),
            json!({"x": 1, "y": 1, "epsilon": 0.019}),
            json!({"x": 1, "y": 1, "success_hold": 0.501}),
        ] {
            let stage = Stage::<2>::start().await;
            let mut client = stage.connect();
            stage.enable().await;
            client.subscribe(RESULT).await;
            client.subscribe(FEEDBACK).await;
            client.ask(SEND, args).await;
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
        let (stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        // The end effector is at (3, 0) and points along 0.
        let mut oriented = to(2.9, 0.0);
        oriented.target.orientation = Some(0.3);
        oriented.criteria = Criteria {
            epsilon: 0.11,
            success_hold: 0.1,
        };
        stage.send_goal(oriented).await;
        let result = client.message(RESULT).await;
        assert_eq!(result["outcome"], "reached");
        assert!((number(&result["final_distance"]) - 0.1).abs() < ROUNDING);
    });
}
