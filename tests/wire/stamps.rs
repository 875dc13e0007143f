//! Stamps, under the names of ROS 2 and, for clients that ask for a type of ROS 1, under its names too.
//!
//! **Invariant:** a client that names no type, or that of ROS 2, gets the members that the definition has.

use crate::common::{Client, Runtime};
use serde_json::{Value, json};

fn stamp_of(client: &mut Client, topic: &str, type_name: Option<&str>) -> Value {
    let mut subscribe = json!({"op": "subscribe", "topic": topic, "id": "s"});
    if let Some(name) = type_name {
        subscribe["type"] = json!(name);
    }
    client.send(&subscribe);
    client.kept.clear();
    let mut message = client.message(topic);
    client.send(&json!({"op": "unsubscribe", "topic": topic}));
    client.settle();
    [
        "/header/stamp",
        "/clock",
        "/stamp",
        "/transforms/1/header/stamp",
    ]
    .iter()
    .find_map(|path| message.pointer_mut(path).map(Value::take))
    .expect("a stamp")
}

#[test]
fn a_type_of_ros_1_brings_its_names_beside_those_of_ros_2() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (topic, ros1, ros2) in [
        (
            "/joint_states",
            "sensor_msgs/JointState",
            "sensor_msgs/msg/JointState",
        ),
        ("clock", "rosgraph_msgs/Clock", "rosgraph_msgs/msg/Clock"),
        ("/tf", "tf2_msgs/TFMessage", "tf2_msgs/msg/TFMessage"),
    ] {
        let stamp = stamp_of(&mut client, topic, Some(ros1));
        assert_eq!(stamp.as_object().unwrap().len(), 4, "{stamp}");
        assert_eq!(stamp["secs"], stamp["sec"]);
        assert_eq!(stamp["nsecs"], stamp["nanosec"]);
        for other in [None, Some(ros2), Some("std_msgs/Other")] {
            let stamp = stamp_of(&mut client, topic, other);
            assert_eq!(stamp.as_object().unwrap().len(), 2, "{stamp}");
            assert!(stamp["nanosec"].is_u64());
        }
    }
}

#[test]
fn the_names_of_ros_1_come_in_fragments_and_latched_too() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let subscribe = json!({"op": "subscribe", "topic": "/clock", "type": "rosgraph_msgs/Clock",
                           "fragment_size": 40});
    client.send(&subscribe);
    let text: String = (0..4)
        .map(|_| client.receive_where("a fragment", |frame| frame["op"] == "fragment"))
        .map(|piece| piece["data"].as_str().unwrap().to_owned())
        .collect();
    assert!(text.contains("\"secs\":0,\"nsecs\":"), "{text}");

    // The first subscriber has the owner publish; the second gets what is kept.
    let mut others = [runtime.connect(), runtime.connect()];
    for other in &mut others {
        other
            .send(&json!({"op": "subscribe", "topic": "/tf_static", "type": "tf2_msgs/TFMessage"}));
        let message = other.message("/tf_static");
        let stamp = &message["transforms"][0]["header"]["stamp"];
        assert!(stamp["secs"].is_u64(), "{stamp}");
        assert_eq!(
            (&stamp["secs"], &stamp["nsecs"]),
            (&stamp["sec"], &stamp["nanosec"])
        );
    }
}
