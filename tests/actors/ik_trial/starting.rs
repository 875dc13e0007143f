//! `/ik_trial/start`, `/ik_trial/skip`, `/ik_trial/stop`.

use super::*;

#[test]
fn start_answers_with_the_settings_in_force_and_keeps_what_is_not_named() {
    in_virtual_time(async {
        let (stage, _client) = floating_and_watched().await;
        let mut settings = Settings {
            duration: 60.0,
            criteria: Criteria {
                epsilon: 0.02,
                success_hold: 0.5,
            },
        };
        assert_eq!(begin(&stage.trial, StartTrial::default()).await, settings);
        let changes = Changes {
            epsilon: Some(0.1),
            ..Changes::default()
        };
        settings.criteria.epsilon = 0.1;
        assert_eq!(begin(&stage.trial, changed(changes)).await, settings);
        let changes = Changes {
            duration: Some(30.0),
            success_hold: Some(0.0),
            ..Changes::default()
        };
        settings.duration = 30.0;
        settings.criteria.success_hold = 0.0;
        assert_eq!(begin(&stage.trial, changed(changes)).await, settings);
        assert_eq!(begin(&stage.trial, StartTrial::default()).await, settings);
    });
}

#[test]
fn start_begins_afresh_and_cancels_the_goal_that_was_left_over() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, easy(60.0, 0.1)).await;
        client.messages_for(ms(1000), STATUS).await;
        let before = status(&mut client).await;
        assert!(number(&before["targets_reached"]) > 5.0);
        client.heard.clear();
        begin(&stage.trial, hard(60.0)).await;
        client.settle().await;
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
fn skip_abandons_the_target_uncounted_and_goes_for_another_at_once() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, hard(60.0)).await;
        let before = status(&mut client).await;
        client.heard.clear();
        assert_eq!(asked(&stage.trial, SkipTarget).await, Ok(()));
        client.settle().await;
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
