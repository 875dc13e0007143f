//! Enable, start: targets are reached, and they are reachable and repeatable.

use super::*;

async fn targets_per_minute<const N: usize>() -> u64
where
    Gains<N>: Default,
{
    let stage = Stage::<N>::start().await;
    let mut client = stage.connect();
    client.subscribe(STATUS).await;
    stage.enable().await;
    begin(&stage.trial, StartTrial::default()).await;
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

/// Over 50 seeds 38 to 41 targets a minute are reached with 2 links (39 on average), 24 to 27 with 3 (25).
#[test]
fn a_client_that_only_enables_and_starts_sees_targets_reached_counted_and_reported() {
    in_virtual_time(async {
        let two = targets_per_minute::<2>().await;
        let three = targets_per_minute::<3>().await;
        assert!((36..=43).contains(&two), "{two} with 2 links");
        assert!((22..=32).contains(&three), "{three} with 3 links");
    });
}

/// Reachable whatever the lengths: none of the goals is refused, which would show as `idle` after the first `active`.
#[test]
fn targets_are_reachable_at_any_lengths_also_when_these_change_during_the_trial() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, easy(60.0, 0.0)).await;
        for lengths in [[1e-3, 1e3], [5.0, 1e-6], [2.0, 2.0], [1e-5, 1e-5]] {
            stage.set_lengths(lengths).await;
            client.settle().await;
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
