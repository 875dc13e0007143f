//! Messages of a record, as they come at any speed and while it stands.

use super::*;
use crate::recorder::passages;

/// Some ticks: a place that is sought again so soon is shown at the next one.
const TICKS: std::time::Duration = ms(50);

/// The messages of a topic, as they stand in the record.
fn recorded(entries: &[RecordEntry], topic: &str) -> Vec<Value> {
    let (all, _) = passages(&file(entries));
    let of_topic = all.into_iter().filter(|one| one.topic == topic);
    of_topic.map(|one| one.msg.unwrap()).collect()
}

#[test]
fn topics_are_published_as_they_were_recorded() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("as-recorded", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        seek(&mut client, 0, 0).await;
        for topic in [
            "/joint_states",
            "/tf",
            "/clock",
            "/joint_trajectory",
            "/diagnostics",
        ] {
            client.subscribe(topic).await;
        }
        let before = client.heard.len();
        drive(&mut client, "resume", json!({})).await;
        client.messages_for(ms(5000), "/clock").await;
        for topic in [
            "/joint_states",
            "/tf",
            "/clock",
            "/joint_trajectory",
            "/diagnostics",
        ] {
            let mut heard: Vec<Value> = client.heard[before..]
                .iter()
                .filter(|frame| frame["topic"] == topic)
                .map(|frame| frame["msg"].clone())
                .collect();
            // While it stood, the one that was present came again.
            heard.dedup();
            let all = recorded(&entries, topic);
            assert!(
                heard.len() >= all.len() - 1,
                "{topic}: {} of {}",
                heard.len(),
                all.len()
            );
            // The first may have come before.
            let first = all.iter().position(|one| *one == heard[0]).unwrap();
            assert!(first <= 1, "{topic} begins with message {first}");
            let length = all.len() - first;
            assert_eq!(heard[..length], all[first..], "{topic}");
        }
        let end = drive(&mut client, "get_position", json!({})).await;
        assert_eq!(end["position"], end["duration"]);
        assert!((number(&end["duration"]) - 4.0).abs() < 0.1, "{end}");
    });
}

#[test]
fn a_record_goes_backward_and_at_other_speeds() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("backward", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "set_rate", json!({"rate": -2})).await;
        assert_eq!(
            drive(&mut client, "get_rate", json!({})).await,
            json!({"rate": -2.0})
        );
        client.subscribe("/joint_states").await;
        seek(&mut client, 3, 0).await;
        client.settle().await;
        let before = client.messages("/joint_states").len();
        let heard = client.messages_for(ms(1000), "/joint_states").await;
        // Two seconds of a record with sixty a second, give or take a tick at either end.
        assert!((117..=123).contains(&heard.len()), "{}", heard.len());
        let times: Vec<f64> = heard.iter().map(time_of).collect();
        assert!(times.is_sorted_by(|a, b| a > b), "{times:?}");
        assert!(before > 0, "the state at the place that was sought");
        let all = recorded(&entries, "/joint_states");
        assert!(heard.iter().all(|one| all.contains(one)));
        // At its beginning it ends, and goes on forward when that is asked.
        client.messages_for(ms(1000), "/joint_states").await;
        assert_eq!(position(&mut client).await, 0.0);
        drive(&mut client, "set_rate", json!({"rate": 0.5})).await;
        let heard = client.messages_for(ms(1000), "/joint_states").await;
        assert!((28..=32).contains(&heard.len()), "{}", heard.len());
        let at = position(&mut client).await;
        assert!((at - 0.5).abs() < 0.05, "{at}");
    });
}

#[test]
fn a_paused_record_shows_where_it_stands() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("paused", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": true})
        );
        seek(&mut client, 0, 0).await;
        client.subscribe("/joint_states").await;
        client.settle().await;
        let state = client.messages("/joint_states").pop().unwrap();
        assert!(
            time_of(&state) < 0.02,
            "at its beginning the first one: {state}"
        );
        seek(&mut client, 1, 500_000_000).await;
        client.messages_for(TICKS, "/joint_states").await;
        let state = client.messages("/joint_states").pop().unwrap();
        assert!((time_of(&state) - 1.5).abs() < 0.05, "{state}");
        // Who comes later gets it within a second.
        let mut late = show.connect();
        late.subscribe("/joint_states").await;
        let heard = late.messages_for(ms(1100), "/joint_states").await;
        assert!(!heard.is_empty() && heard.iter().all(|one| *one == state));
        assert_eq!(position(&mut client).await, 1.5);
        let time = client.ask("/rosapi/get_time", json!({})).await;
        assert_eq!(time["time"]["sec"], 1);
        // The pause that clients know from the arm is the same.
        assert_eq!(client.ask("/arm_sim/pause", json!({})).await["data"], true);
        client.ask("/arm_sim/pause", json!({"data": false})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": false})
        );
        drive(&mut client, "toggle_paused", json!({})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": true})
        );
    });
}

#[test]
fn after_the_answer_that_it_stands_or_is_elsewhere_no_state_from_before_comes() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("stale", &entries).await;
        let mut client = show.connect();
        client
            .send(
                &json!({"op": "subscribe", "topic": "/joint_states", "throttle_rate": 300,
                "queue_length": 20}),
            )
            .await;
        client.messages_for(ms(700), "/joint_states").await;
        drive(&mut client, "pause", json!({})).await;
        let stood = position(&mut client).await;
        let heard = client.messages_for(ms(2000), "/joint_states").await;
        assert!(
            heard.iter().all(|state| time_of(state) >= stood - 0.02),
            "{stood} s: {heard:?}"
        );
    });
}

#[test]
fn a_latched_message_is_the_one_that_held_there() {
    let entries = in_virtual_time(run());
    let descriptions = recorded(&entries, "/robot_description");
    assert_eq!(descriptions.len(), 2);
    in_virtual_time(async {
        let show = Show::of("latched", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        seek(&mut client, 3, 0).await;
        client.subscribe("/robot_description").await;
        client.settle().await;
        assert_eq!(
            client.messages("/robot_description"),
            [descriptions[1].clone()]
        );
        let mut other = show.connect();
        other.subscribe("/robot_description").await;
        other.settle().await;
        assert_eq!(
            other.messages("/robot_description"),
            [descriptions[1].clone()]
        );
        seek(&mut client, 1, 0).await;
        client.messages_for(TICKS, "/robot_description").await;
        assert_eq!(
            client.messages("/robot_description").last(),
            Some(&descriptions[0])
        );
        // It is not repeated while the record stands.
        assert!(
            client
                .messages_for(ms(3000), "/robot_description")
                .await
                .is_empty()
        );
    });
}
