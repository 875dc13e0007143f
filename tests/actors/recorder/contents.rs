//! Topics, calls and frames that a record holds, and those that it leaves out.

use std::collections::HashMap;

use super::*;
use pendularm::actors::recorder::limits::MAX_RECORDED_FRAME;
use pendularm::protocol::catalog::Topic;
use pendularm::record::{CALLS, INPUTS, STATES};
use serde_json::Value;

#[test]
fn every_topic_is_recorded_without_subscribers_and_none_is_made_afterwards() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let notes = Notes::default();
        notes.take(&stage).await;
        let command = json!({"op": "publish", "topic": "/effort_controller/commands", "msg": {"data": [0, 0]}});
        client.send(&command).await;
        client.enable().await;
        client.ask("/ik_trial/start", json!({"duration": 3})).await;
        sleep(ms(4000)).await;
        stop(&stage).await;
        let before = notes.entries().len();
        sleep(ms(2000)).await;
        assert_eq!(notes.entries().len(), before);

        let (passages, ending) = passages(&file(&notes.entries()));
        assert_eq!((passages.len(), ending), (before, RecordEnding::Whole));
        let mut counts: HashMap<&str, u32> = HashMap::new();
        for passage in &passages {
            let count = counts.entry(passage.topic.as_str()).or_default();
            *count += 1;
            assert_eq!(passage.sequence, *count);
            assert!(passage.msg.is_some(), "{}", passage.topic);
        }
        // Without the study there are no warnings; the node of transforms is not there.
        let others = [INPUTS, STATES, CALLS];
        let unasked = [
            Topic::Rosout,
            Topic::TfWeb,
            Topic::TfWebGoal,
            Topic::TfWebCancel,
            Topic::TfWebFeedback,
        ];
        let topics = Topic::ALL.into_iter().filter(|one| !unasked.contains(one));
        for topic in topics.map(Topic::name).chain(others) {
            assert!(counts.contains_key(topic), "{topic} is missing: {counts:?}");
        }
        assert!(counts["/joint_states"] >= 239, "60 a second: {counts:?}");
        assert_eq!(counts["/robot_description"], 1);
    });
}

#[test]
fn a_subscriber_that_comes_while_it_is_recorded_gets_the_latched_message() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let notes = Notes::default();
        notes.take(&stage).await;
        sleep(ms(100)).await;
        let mut client = stage.connect();
        client.subscribe("/robot_description").await;
        client.settle().await;
        assert_eq!(client.messages("/robot_description").len(), 1);
        // The end of the record is not the end of the subscription.
        stop(&stage).await;
        client
            .ask("/arm_sim/set_params", json!({"lengths": [2.0, 1.0]}))
            .await;
        assert_eq!(client.messages("/robot_description").len(), 2);
    });
}

#[test]
fn calls_are_recorded_with_their_answers() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let notes = Notes::default();
        notes.take(&stage).await;
        client
            .ask("/arm_sim/set_params", json!({"gravity": 3.5}))
            .await;
        client
            .call("/arm_sim/set_params", json!({"gravity": -1}))
            .await;
        let (passages, _) = passages(&file(&notes.entries()));
        let calls: Vec<Value> = passages
            .into_iter()
            .filter(|one| one.topic == CALLS)
            .map(|one| one.msg.unwrap())
            .collect();
        assert_eq!(calls.len(), 4);
        assert_eq!(calls[0]["service"], "/arm_sim/set_params");
        assert_eq!(calls[0]["type"], "pendularm_interfaces/srv/SetParams");
        assert_eq!(calls[0]["content"], "{\"gravity\":3.5}");
        assert_eq!(calls[1]["is_answer"], true);
        assert_eq!(calls[1]["id"], calls[0]["id"]);
        let values: Value = serde_json::from_str(calls[1]["content"].as_str().unwrap()).unwrap();
        assert_eq!(values["gravity"], 3.5);
        assert_eq!(calls[1]["result"], true);
        assert_eq!(calls[3]["result"], false);
        assert!(calls[3]["status"].as_str().unwrap().starts_with("gravity"));
    });
}

#[test]
fn a_frame_that_is_too_long_is_left_out_and_counted() {
    use pendularm::actors::ConnectionId;
    use pendularm::actors::gateway::registry::Tapped;
    use pendularm::protocol::catalog::Service;
    use pendularm::protocol::wire::json::Payload;
    use serde_json::value::RawValue;

    let are_kept = Arc::new(Mutex::new(Vec::new()));
    let noted = Arc::clone(&are_kept);
    let note = move |content: Option<_>| noted.lock().unwrap().push(content.is_some());
    let mut tap = listeners::registry(note);
    for length in [MAX_RECORDED_FRAME, MAX_RECORDED_FRAME + 1] {
        tap(Tapped::Answered {
            to: ConnectionId(1),
            service: Service::Rollout,
            frame: &vec![b' '; length].into(),
        });
    }
    // The name of a called service is copied too.
    let payload = |text: String| Payload::from(RawValue::from_string(text).unwrap());
    let args = payload("{}".to_owned());
    for length in [MAX_RECORDED_FRAME - 2, MAX_RECORDED_FRAME - 1] {
        let id = payload(format!("\"{}\"", "x".repeat(length - 2)));
        tap(Tapped::Called {
            from: ConnectionId(1),
            service: Service::Rollout,
            id: Some(&id),
            args: &args,
        });
    }
    assert_eq!(*are_kept.lock().unwrap(), [true, false, true, false]);
}
