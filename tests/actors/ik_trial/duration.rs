//! Time: how long a trial lasts, and the targets that count within it.

use super::*;

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
