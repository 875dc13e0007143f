//! Trials while somebody else acts on goals, and what a trial leaves in flight.

use super::*;

/// Three ways to lose a goal to somebody else; each shows, and the trial waits.
#[test]
fn a_trial_whose_goal_is_preempted_by_somebody_else_shows_that_and_waits() {
    in_virtual_time(async {
        for way in ["a goal of its own", "a cancellation", "a reset"] {
            let (stage, mut client) = floating_and_watched().await;
            begin(&stage.trial, hard(60.0)).await;
            let before = status(&mut client).await;
            assert_eq!(before["action_status"], "active");
            client.heard.clear();
            match way {
                "a reset" => stage.reset().await,
                "a cancellation" => stage.cancel().await.unwrap(),
                _ => drop(stage.send_goal(theirs()).await),
            }
            for after in client.messages_for(ms(2000), STATUS).await {
                assert_eq!(after["running"], true, "{way}");
                assert_eq!(after["action_status"], "preempted");
                assert_eq!(after["target"], before["target"]);
                assert_eq!(after["error"], Value::Null);
                assert_eq!(after["desired_positions"], Value::Null);
            }
            assert_eq!(client.messages(RESULT).len(), 1);
        }
    });
}

/// A trial that ends must not take somebody else's goal with it.
#[test]
fn a_trial_cancels_no_goal_but_its_own() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        let trial = &stage.trial;
        for end in ["stop", "skip", "start"] {
            begin(trial, hard(60.0)).await;
            let goal_id = stage.send_goal(theirs()).await;
            client.settle().await;
            client.heard.clear();
            match end {
                "stop" => asked(trial, StopTrial).await.unwrap(),
                "skip" => asked(trial, SkipTarget).await.unwrap(),
                _ => {
                    begin(trial, StartTrial::default()).await;
                }
            }
            client.settle().await;
            let ended: Vec<Value> = client.messages(RESULT);
            if end == "stop" {
                assert!(ended.is_empty());
                let goal = Meant::Called(goal_id);
                assert_eq!(asked(&stage.action, CancelGoal { goal }).await, Ok(()));
            } else {
                // A new target of the trial preempts any goal, as one of anybody else would.
                assert_eq!(ended.len(), 1);
                assert_eq!(ended[0]["goal_id"], goal_id);
            }
        }
    });
}

#[test]
fn trials_outlive_the_client_that_started_them() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        let mut other = stage.connect();
        let easy = json!({"duration": 2, "epsilon": 1e6, "success_hold": 0.1});
        other.ask(START, easy).await;
        drop(other);
        client.messages_for(ms(2100), STATUS).await;
        let end = client.messages(STATUS).pop().unwrap();
        assert_eq!(end["running"], false);
        assert!(number(&end["targets_reached"]) > 10.0);
    });
}

#[test]
fn the_goal_is_under_way_when_start_is_answered_and_what_follows_finds_it() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, hard(60.0)).await;
        assert_eq!(stage.cancel().await, Ok(()));
        assert_eq!(asked(&stage.trial, SkipTarget).await, Ok(()));
        stage.send_goal(theirs()).await;
        client.settle().await;
        assert_eq!(client.messages(RESULT).len(), 2);
    });
}

#[test]
fn stop_ends_the_trial_and_leaves_nothing_in_flight() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, hard(60.0)).await;
        let before = status(&mut client).await;
        assert!(before["error"].is_number());
        client.heard.clear();
        assert_eq!(asked(&stage.trial, StopTrial).await, Ok(()));
        client.settle().await;
        assert_eq!(client.messages(RESULT).len(), 1);
        assert!(stage.cancel().await.is_err(), "no goal is left");
        for after in client.messages_for(ms(1000), STATUS).await {
            assert_eq!(after["running"], false);
            assert_nothing_in_flight(&after);
            // Its clock has stopped.
            assert!(number(&after["elapsed"]) - number(&before["elapsed"]) < 0.11);
        }
        assert_eq!(client.messages(RESULT).len(), 1, "and no replacement");
    });
}
