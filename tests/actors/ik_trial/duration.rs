//! Time: how long a trial lasts, and the targets that count within it.

use super::*;

#[test]
fn when_its_duration_is_over_the_trial_ends_and_abandons_its_target() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, hard(2.5)).await;
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
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, hard(1.0)).await;
        pass(ms(995)).await;
        stage.pause(true).await;
        client.messages_for(ms(60_000), STATUS).await;
        let paused = client.messages(STATUS).pop().unwrap();
        assert_eq!(paused["running"], true);
        assert!((number(&paused["elapsed"]) - 0.995).abs() < ROUNDING);
        stage.pause(false).await;
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
                let (stage, mut client) = floating_and_watched().await;
                pass(ms(offset)).await;
                begin(&stage.trial, easy(duration, 0.1)).await;
                client.messages_for(ms(300), STATUS).await;
                let end = client.messages(STATUS).pop().unwrap();
                assert_eq!(end["running"], false);
                assert_eq!(end["targets_reached"], count, "{duration} at {offset} ms");
            }
        }
    });
}

/// No timer can be set to such a time.
#[test]
fn a_trial_may_last_longer_than_any_timer() {
    in_virtual_time(async {
        let (stage, _client) = floating_and_watched().await;
        let settings = begin(&stage.trial, hard(1e300)).await;
        assert_eq!(settings.duration, 1e300);
        assert_eq!(asked(&stage.trial, StopTrial).await, Ok(()));
    });
}
