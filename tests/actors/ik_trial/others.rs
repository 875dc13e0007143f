//! What becomes of a trial when somebody else acts on goals.

use super::*;

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
