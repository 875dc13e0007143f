//! Enable, start: targets are reached, counted and reported.

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
