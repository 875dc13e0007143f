//! Questions about services and actions: which there are, of which type, who provides them.

use pendularm::protocol::catalog::{Action, Node, Rosapi, Service};
use serde_json::json;

use super::values;

#[test]
fn services_are_listed_under_every_name_they_have() {
    let mut services: Vec<String> = Service::ALL.map(|one| one.name().to_owned()).to_vec();
    for question in Rosapi::ALL {
        for prefix in ["/rosapi/", "/rosapi_node/"] {
            services.push(format!("{prefix}{}", question.short_name()));
        }
    }
    services.extend(["/add".to_owned(), "/nameless".to_owned()]);
    assert_eq!(
        values(Rosapi::Services, json!({})),
        json!({"services": services})
    );
}

#[test]
fn services_of_a_type_and_who_provides_them_are_found_by_all_of_its_names() {
    for (type_name, services, providers) in [
        (
            "pendularm_interfaces/srv/Solve",
            &["/ik/solve"][..],
            &["/ik"][..],
        ),
        ("pendularm_interfaces/Solve", &["/ik/solve"], &["/ik"]),
        (
            "rosapi_msgs/Topics",
            &["/rosapi/topics", "/rosapi_node/topics"],
            &["/rosapi"],
        ),
        // As it was called before ROS 2.
        (
            "rosapi/Topics",
            &["/rosapi/topics", "/rosapi_node/topics"],
            &["/rosapi"],
        ),
        ("demo/Add", &["/add"], &["/gateway"]),
        ("demo/srv/Add", &["/add"], &["/gateway"]),
        ("demo/None", &[], &[]),
        ("", &[], &[]),
    ] {
        let found = values(Rosapi::ServicesForType, json!({"type": type_name}));
        assert_eq!(found, json!({"services": services}), "{type_name}");
        let found = values(Rosapi::ServiceProviders, json!({"service": type_name}));
        assert_eq!(found, json!({"providers": providers}), "{type_name}");
    }
}

#[test]
fn a_services_type_and_node_are_told_and_are_empty_where_there_is_no_such_service() {
    for (service, type_name, node) in [
        (
            "/ik_trial/stop",
            "pendularm_interfaces/srv/TrialStop",
            "/ik_trial",
        ),
        ("ik/solve", "pendularm_interfaces/srv/Solve", "/ik"),
        ("/rosapi_node/nodes", "rosapi_msgs/srv/Nodes", "/rosapi"),
        ("add", "demo/srv/Add", "/gateway"),
        ("/nameless", "", "/gateway"),
        ("/none", "", ""),
    ] {
        let service = json!({"service": service});
        let found = values(Rosapi::ServiceType, service.clone());
        assert_eq!(found, json!({"type": type_name}), "{service}");
        let found = values(Rosapi::ServiceNode, service.clone());
        assert_eq!(found, json!({"node": node}), "{service}");
    }
}

#[test]
fn actions_are_listed_with_their_type() {
    assert_eq!(
        values(Rosapi::ActionServers, json!({})),
        json!({"action_servers": [
            "/ik_action",
            "/tf2_web_republisher",
            "/joint_trajectory_controller/follow_joint_trajectory",
            "/dance",
            "/untyped"
        ]})
    );
    for (action, type_name) in [
        ("/ik_action", "pendularm_interfaces/action/MoveTo"),
        ("ik_action", "pendularm_interfaces/action/MoveTo"),
        ("dance", "demo/action/Dance"),
        ("/untyped", ""),
        ("/ik", ""),
    ] {
        assert_eq!(
            values(Rosapi::ActionType, json!({"action": action})),
            json!({"type": type_name})
        );
    }
    assert_eq!(Action::MoveTo.owner(), Node::IkAction);
}
