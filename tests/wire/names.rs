//! Names with and without the leading slash are one thing, and every client hears the spelling that it used.
//!
//! **Invariant:** each test has both spellings in it.

use crate::arm::ticks;
use crate::common::Runtime;
use serde_json::json;

#[test]
fn a_topic_is_delivered_in_the_spelling_of_each_subscriber() {
    let runtime = Runtime::start();
    let (mut with, mut without) = (runtime.connect(), runtime.connect());
    for (client, topic) in [(&mut with, "/joint_states"), (&mut without, "joint_states")] {
        client.send(&json!({"op": "subscribe", "topic": topic}));
        assert_eq!(client.status()["msg"], format!("subscribed to {topic}"));
        let message = client.message(topic);
        assert_eq!(message["name"], json!(["joint1", "joint2"]));
    }
    drop(with);
    // The topic goes on for those who are left, whatever they call it.
    for _ in 0..30 {
        without.message("joint_states");
    }
}

#[test]
fn clients_meet_on_a_topic_that_they_spell_differently() {
    let runtime = Runtime::start();
    let (mut talker, mut listener) = (runtime.connect(), runtime.connect());
    listener.subscribe("/chat");
    talker.send(&json!({"op": "advertise", "topic": "chat"}));
    talker.send(&json!({"op": "publish", "topic": "/chat", "msg": {"n": 1}}));
    talker.send(&json!({"op": "publish", "topic": "chat", "msg": {"n": 2}}));
    assert_eq!(listener.message("/chat")["n"], 1);
    assert_eq!(listener.message("/chat")["n"], 2);
    talker.send(&json!({"op": "unadvertise", "topic": "/chat"}));
    talker.send(&json!({"op": "publish", "topic": "chat", "msg": {"n": 3}}));
    talker.settle();
    assert!(listener.so_far().is_empty());
}

#[test]
fn the_runtimes_topics_are_guarded_under_both_spellings() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "publish", "topic": "joint_states", "msg": {}}));
    assert_eq!(client.status()["level"], "error");
    client.send(&json!({"op": "advertise_service", "service": "arm_sim/reset"}));
    assert_eq!(client.status()["level"], "error");
    client.send(&json!({"op": "publish", "topic": "joint_trajectory", "msg": {"points": []}}));
    let status = client.status();
    assert!(
        status["msg"].as_str().unwrap().contains("points"),
        "{status}"
    );
}

#[test]
fn a_service_answers_under_the_name_that_it_was_called_by() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for service in [
        "/arm_sim/set_params",
        "arm_sim/set_params",
        "rosapi/topics",
        "none",
    ] {
        assert_eq!(client.call(service, json!({}))["service"], service);
    }
}

#[test]
fn a_provider_is_called_by_its_own_spelling_and_the_caller_answered_in_his() {
    let runtime = Runtime::start();
    let (mut provider, mut caller) = (runtime.connect(), runtime.connect());
    provider.send(&json!({"op": "advertise_service", "service": "add"}));
    assert_eq!(provider.status()["msg"], "advertised service add");
    caller.send(&json!({"op": "call_service", "service": "/add", "id": 1}));
    let call = provider.receive();
    assert_eq!(call["service"], "add");
    provider.send(
        &json!({"op": "service_response", "service": "add", "id": call["id"],
        "values": {}, "result": true}),
    );
    let response = caller.receive();
    assert_eq!(
        (&response["service"], &response["result"]),
        (&json!("/add"), &json!(true))
    );
    provider.send(&json!({"op": "unadvertise_service", "service": "/add"}));
    provider.settle();
    assert!(caller.refusal("add", json!({})).contains("no provider"));
}

/// A state of the arm that was held back is old once the arm has answered, under either spelling.
#[test]
fn after_a_response_no_older_state_follows_under_either_spelling() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "subscribe", "topic": "joint_states", "throttle_rate": 300}));
    client.message("joint_states");
    // Some ticks later messages are held back: another client, which is not throttled, has seen them.
    let mut other = runtime.connect();
    other.subscribe("/joint_states");
    ticks(&mut other, 6);
    client.ask("/arm_sim/reset", json!({}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/reset", json!({}));
    let stamp = client.message("joint_states")["header"]["stamp"].clone();
    assert_eq!(stamp, json!({"sec": 0, "nanosec": 0}));
}
