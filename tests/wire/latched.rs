//! Topics for 3D tools: frames, the description, warnings.
//!
//! **Invariant:** what a latched topic says is there for every new subscriber, however late.

use crate::common::Runtime;
use serde_json::{Value, json};

#[test]
fn every_new_subscriber_gets_the_description_and_the_fixed_frame_once() {
    let runtime = Runtime::start();
    let mut clients: Vec<_> = (0..3).map(|_| runtime.connect()).collect();
    for client in &mut clients {
        for topic in ["/robot_description", "/tf_static", "robot_description"] {
            client.send(&json!({"op": "subscribe", "topic": topic}));
            assert_eq!(client.status()["level"], "info");
            let message = client.message(topic);
            if topic == "/tf_static" {
                assert_eq!(message["transforms"][0]["child_frame_id"], "hand");
            } else {
                assert!(message["data"].as_str().unwrap().starts_with("<?xml"));
            }
        }
        // The same subscription has it already.
        client.send(&json!({"op": "subscribe", "topic": "/tf_static", "throttle_rate": 5}));
        client.status();
    }
    for client in &mut clients {
        assert!(client.so_far().is_empty());
    }
}

/// Each part of a program subscribes for itself. A throttle does not hold back the first message of a subscription.
#[test]
fn every_subscription_of_a_client_gets_what_is_latched_once_and_live_messages_come_once() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let topics = ["/robot_description", "/tf_static", "tf_static"];
    let ids = [json!("a"), json!(2), json!(null), json!("d"), json!("e")];
    let more = [
        json!({}),
        json!({"throttle_rate": 60_000, "queue_length": 3}),
        json!({"compression": "png"}),
        json!({"type": "tf2_msgs/msg/TFMessage"}),
        json!({"throttle_rate": 60_000}),
    ];
    let subscribe = |client: &mut crate::common::Client, topic: &str, id: &Value, more: &Value| {
        let mut frame = json!({"op": "subscribe", "topic": topic, "id": id});
        frame
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        client.send(&frame);
        assert_eq!(client.status()["level"], "info", "{frame}");
    };
    for topic in topics {
        for (id, more) in ids.iter().zip(&more) {
            subscribe(&mut client, topic, id, more);
            client.message(topic);
        }
        // Unsubscribed and subscribed again, it is a new one; the same one again is not.
        client.send(&json!({"op": "unsubscribe", "topic": topic, "id": "a"}));
        subscribe(
            &mut client,
            topic,
            &json!("a"),
            &json!({"throttle_rate": 60_000}),
        );
        client.message(topic);
        subscribe(&mut client, topic, &json!("d"), &json!({}));
    }
    assert!(client.so_far().is_empty());
    client.ask("/arm_sim/set_params", json!({"lengths": [1.0, 0.25]}));
    client.settle();
    let told = std::mem::take(&mut client.kept);
    let told: Vec<_> = told.iter().map(|frame| frame["topic"].clone()).collect();
    for topic in topics {
        let count = told.iter().filter(|one| **one == topic).count();
        assert_eq!(count, 1, "{topic}: {told:?}");
    }
    // All are throttled now, and each still gets it at once.
    for id in ["d", "2nd", "3rd"] {
        client.send(&json!({"op": "unsubscribe", "topic": "/tf_static"}));
        subscribe(
            &mut client,
            "/tf_static",
            &json!(id),
            &json!({"throttle_rate": 60_000}),
        );
        client.message("/tf_static");
        subscribe(
            &mut client,
            "/tf_static",
            &json!("last"),
            &json!({"throttle_rate": 60_000}),
        );
        client.message("/tf_static");
    }
}

#[test]
fn a_change_of_the_arm_is_told_and_then_is_what_new_subscribers_get() {
    let runtime = Runtime::start();
    let (mut early, mut late) = (runtime.connect(), runtime.connect());
    early.subscribe("/tf_static");
    early.message("/tf_static");
    early.ask("/arm_sim/set_params", json!({"lengths": [1.0, 0.25]}));
    early.ask("/arm_sim/set_params", json!({"lengths": [1.0, 0.25]}));
    late.subscribe("/tf_static");
    // Told before the change was answered, and once: the second request changed nothing.
    let told: Vec<Value> = std::mem::take(&mut early.kept);
    assert_eq!(told.len(), 1, "{told:?}");
    for message in [&told[0]["msg"], &late.message("/tf_static")] {
        assert_eq!(message["transforms"][0]["header"]["frame_id"], "link2");
        assert_eq!(
            message["transforms"][0]["transform"]["translation"]["x"],
            0.25
        );
    }
    assert!(late.so_far().is_empty());
}

#[test]
fn a_client_that_comes_back_gets_the_description_as_it_is_now() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/robot_description");
    client.message("/robot_description");
    client.send(&json!({"op": "unsubscribe", "topic": "/robot_description"}));
    client.ask("/arm_sim/set_params", json!({"masses": [1.0, 7.5]}));
    client.subscribe("/robot_description");
    let urdf = client.message("/robot_description");
    assert!(
        urdf["data"]
            .as_str()
            .unwrap()
            .contains("mass value=\"7.5\"")
    );
}

/// With both joints at a right angle the second link's frame stands at the first one's end, turned by a quarter:
/// z = sin 45°, w = cos 45°.
#[test]
fn the_frames_follow_the_joints() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.ask(
        "/arm_sim/set_params",
        json!({"gravity": 0.0, "lengths": [0.5, 1.0]}),
    );
    client.subscribe("/tf");
    let frames = client.message("/tf");
    let link1 = &frames["transforms"][0];
    let link2 = &frames["transforms"][1];
    assert_eq!(
        (&link1["header"]["frame_id"], &link1["child_frame_id"]),
        (&json!("world"), &json!("link1"))
    );
    assert_eq!(
        (&link2["header"]["frame_id"], &link2["child_frame_id"]),
        (&json!("link1"), &json!("link2"))
    );
    assert_eq!(link2["transform"]["translation"]["x"], 0.5);

    client.ask("/pid_controller/enable", json!({"data": true}));
    client.subscribe("/joint_states");
    let half = std::f64::consts::FRAC_PI_2;
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": [half, half]}]}}));
    let angle = |state: &Value| state["position"][1].as_f64().unwrap();
    client.receive_where("arrival", |frame| {
        frame["topic"] == "/joint_states" && (angle(&frame["msg"]) - half).abs() < 0.01
    });
    client.ask("/arm_sim/pause", json!({"data": true}));
    let state = client.message("/joint_states");
    let frames = client.message("/tf");
    let rotation = &frames["transforms"][1]["transform"]["rotation"];
    // Printed numbers lead back to the same bits, so this is exact to the rounding of one sine.
    let expected = (angle(&state) / 2.0).sin_cos();
    assert!((rotation["z"].as_f64().unwrap() - expected.0).abs() < 1e-15);
    assert!((rotation["w"].as_f64().unwrap() - expected.1).abs() < 1e-15);
    assert_eq!(
        frames["transforms"][0]["header"]["stamp"],
        state["header"]["stamp"]
    );
}

/// Gains far too large for the timestep: the arm diverges and says so, though the log is off.
#[test]
fn warnings_are_told_on_rosout_even_with_the_log_off() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("rosout");
    client.ask(
        "/pid_controller/set_gains",
        json!({"kp": [1e6, 1e6], "kd": [1e5, 1e5]}),
    );
    client.ask("/arm_sim/set_integrator", json!({"timestep": 0.02}));
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.send(&json!({"op": "publish", "topic": "/joint_trajectory",
        "msg": {"points": [{"positions": [1.0, 1.0]}]}}));
    let log = client.message("rosout");
    assert_eq!(log["level"], 30);
    assert_eq!(log["name"], "arm_sim");
    assert!(
        log["msg"]
            .as_str()
            .unwrap()
            .starts_with("the simulation has diverged step="),
        "{log}"
    );
    assert!(log["file"].as_str().unwrap().ends_with(".rs"));
}
