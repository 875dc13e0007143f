//! Questions about nodes, and about the version of ROS.

use pendularm::protocol::catalog::{Node, Rosapi};
use serde_json::json;

use super::values;

#[test]
fn every_node_is_listed_and_tells_what_it_does() {
    let nodes = Node::ALL.map(|node| format!("/{}", node.name()));
    assert_eq!(values(Rosapi::Nodes, json!({})), json!({"nodes": nodes}));
    for name in ["/ik_action", "ik_action"] {
        assert_eq!(
            values(Rosapi::NodeDetails, json!({"node": name})),
            json!({
                "subscribing": [],
                "publishing": ["/ik_action/feedback", "/ik_action/result", "/joint_trajectory"],
                "services": ["/ik_action/send_goal", "/ik_action/cancel_goal"],
            })
        );
    }
    let arm = values(Rosapi::NodeDetails, json!({"node": "/arm_sim"}));
    assert_eq!(
        arm["subscribing"],
        json!(["/effort_controller/commands", "/joint_trajectory"])
    );
    let published = arm["publishing"].as_array().unwrap();
    assert!(published.contains(&json!("/clock")) && !published.contains(&json!("/rosout")));
    assert_eq!(
        values(Rosapi::NodeDetails, json!({"node": "/nobody"})),
        json!({"subscribing": [], "publishing": [], "services": []})
    );
}

#[test]
fn the_gateways_details_are_what_clients_do() {
    assert_eq!(
        values(Rosapi::NodeDetails, json!({"node": "/gateway"})),
        json!({
            "subscribing": ["/joint_states", "/wish"],
            "publishing": ["/chat", "/joint_trajectory", "/rosout"],
            "services": ["/add", "/nameless"],
        })
    );
}

#[test]
fn the_version_is_2_of_a_distribution_that_clients_know() {
    assert_eq!(
        values(Rosapi::GetRosVersion, json!({})),
        json!({"version": 2, "distro": "jazzy"})
    );
}
