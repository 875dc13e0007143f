//! `list` of topics, services, actions and parameters.

use serde_json::Value;

use super::said;
use crate::common::Runtime;

#[test]
fn lists_show_names_and_types_and_a_line_each() {
    let runtime = Runtime::start();
    let names = said(&runtime, &["topic", "list"]);
    assert!(names.lines().any(|line| line == "/joint_states"), "{names}");
    let types = said(&runtime, &["topic", "list", "-t"]);
    assert!(
        types.contains("/clock [rosgraph_msgs/msg/Clock]\n"),
        "{types}"
    );
    let services = said(&runtime, &["service", "list", "--show-types", "--json"]);
    let first: Value = serde_json::from_str(services.lines().next().unwrap()).unwrap();
    assert!(first["name"].is_string() && first["type"].as_str().unwrap().contains("/srv/"));
    let actions = said(&runtime, &["action", "list", "-t"]);
    let ours = "/ik_action [pendularm_interfaces/action/MoveTo]\n";
    assert!(actions.contains(ours), "{actions}");
    let parameters = said(&runtime, &["param", "list"]);
    assert!(parameters.contains("/arm_sim gravity\n"), "{parameters}");
}
