//! Questions about topics: which there are, of which type, who publishes and who subscribes.

use pendularm::protocol::catalog::{Rosapi, Topic};
use serde_json::json;

use super::values;

fn own_topics() -> Vec<&'static str> {
    Topic::ALL.iter().map(|topic| topic.name()).collect()
}

#[test]
fn topics_are_the_runtimes_and_then_the_clients_each_with_its_type() {
    let mut topics = own_topics();
    topics.extend(["/chat", "/wish"]);
    let mut types: Vec<&str> = Topic::ALL.iter().map(|topic| topic.type_name()).collect();
    types.extend(["std_msgs/String", ""]);
    assert_eq!(
        values(Rosapi::Topics, json!({})),
        json!({"topics": topics, "types": types})
    );
    let raw = values(Rosapi::TopicsAndRawTypes, json!({}));
    assert_eq!(
        (&raw["topics"], &raw["types"]),
        (&json!(topics), &json!(types))
    );
    let texts = raw["typedefs_full_text"].as_array().unwrap();
    assert_eq!(texts.len(), topics.len());
    // The last two: a type that is known by its short name too, and none.
    assert_eq!(texts[topics.len() - 2], "string data\n");
    assert_eq!(texts[topics.len() - 1], "");
}

#[test]
fn topics_of_a_type_are_found_by_either_of_its_names() {
    for type_name in ["std_msgs/String", "std_msgs/msg/String"] {
        assert_eq!(
            values(Rosapi::TopicsForType, json!({"type": type_name})),
            json!({"topics": ["/robot_description", "/robot_description_semantic", "/chat"]})
        );
    }
    let none = values(Rosapi::TopicsForType, json!({"type": "demo/X"}));
    assert_eq!(none, json!({"topics": []}));
}

#[test]
fn a_topics_type_is_told_and_is_empty_where_nobody_has_named_one() {
    for (topic, type_name) in [
        ("/clock", "rosgraph_msgs/msg/Clock"),
        ("clock", "rosgraph_msgs/msg/Clock"),
        ("/joint_states", "sensor_msgs/msg/JointState"),
        ("chat", "std_msgs/String"),
        ("/chat", "std_msgs/String"),
        ("/wish", ""),
        ("/none", ""),
    ] {
        assert_eq!(
            values(Rosapi::TopicType, json!({"topic": topic})),
            json!({"type": type_name}),
            "{topic}"
        );
    }
}

#[test]
fn clients_appear_as_the_gateway_among_those_that_publish_and_subscribe() {
    for (topic, publishers, subscribers) in [
        ("/clock", &["/arm_sim"][..], &[][..]),
        ("/joint_states", &["/arm_sim"], &["/gateway"]),
        // Goals go there, and here a client's setpoints too.
        (
            "/joint_trajectory",
            &["/gateway", "/ik_action"],
            &["/arm_sim"],
        ),
        ("/rosout", &["/gateway"], &[]),
        ("/chat", &["/gateway"], &[]),
        ("wish", &[], &["/gateway"]),
        ("/none", &[], &[]),
    ] {
        let topic = json!({"topic": topic});
        let published = values(Rosapi::Publishers, topic.clone());
        assert_eq!(published, json!({"publishers": publishers}), "{topic}");
        let subscribed = values(Rosapi::Subscribers, topic.clone());
        assert_eq!(subscribed, json!({"subscribers": subscribers}), "{topic}");
    }
}
