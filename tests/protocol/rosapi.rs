//! Rosapi's answers, from the catalog and from what clients have registered; without a connection.
//!
//! **Invariant:** answers are compared whole; names are spelled here as clients spell them.

use std::sync::Arc;

use pendularm::protocol::catalog::{Action, Node, Playback, Rosapi, Service, Topic, types};
use pendularm::protocol::ros::rosapi::{AnswerError, Census, ListedService, ListedTopic, answer};
use serde_json::{Value, json};

/// Clients that talk on `/chat` and about `/joint_states`, listen to `/wish`, and provide two services.
fn census() -> Census {
    let topic = |name: &str, type_name: Option<&str>, published, subscribed| {
        let type_name = type_name.map(Into::into);
        Arc::new(ListedTopic {
            name: name.into(),
            type_name,
            published,
            subscribed,
        })
    };
    let service = |name: &str, type_name: Option<&str>| {
        let type_name = type_name.map(Into::into);
        Arc::new(ListedService {
            name: name.into(),
            type_name,
        })
    };
    Census {
        topics: vec![
            topic("/chat", Some("std_msgs/String"), true, false),
            topic("/joint_states", None, false, true),
            topic("/joint_trajectory", None, true, false),
            topic("/wish", None, false, true),
        ],
        services: vec![
            service("/add", Some("demo/srv/Add")),
            service("/nameless", None),
        ],
        actions: vec![
            service("/dance", Some("demo/action/Dance")),
            service("/untyped", None),
        ],
        replayed: None,
    }
}

/// The answer about the one name that a request gives.
fn asked(question: Rosapi, args: Value) -> Result<Value, AnswerError> {
    let fields = args.as_object().unwrap();
    let name = fields.values().next().and_then(Value::as_str);
    answer(question, name.unwrap_or_default(), &census())
}

#[track_caller]
fn values(question: Rosapi, args: Value) -> Value {
    match asked(question, args) {
        Ok(values) => values,
        Err(why) => panic!("{question:?}: {why}"),
    }
}

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
fn a_types_text_has_the_types_in_it_behind_lines_of_80_signs() {
    let line = "=".repeat(80);
    let expected = format!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position  # rad\nfloat64[] velocity  # rad/s\n\
         float64[] effort  # N m\n{line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp  # s, ns\nstring frame_id\n\
         {line}\nMSG: builtin_interfaces/Time\nint32 sec  # s\nuint32 nanosec  # ns\n"
    );
    let text = types::full_text("sensor_msgs/JointState").expect("a known type");
    assert_eq!(text, expected);
    assert_eq!(types::full_text("demo/X"), None);
}

#[test]
fn a_types_text_has_its_constants_first() {
    let text = types::full_text("rcl_interfaces/msg/Log").expect("a known type");
    let expected = "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\nbuiltin_interfaces/Time stamp";
    assert!(text.starts_with(expected), "{text}");
    let text = types::full_text("diagnostic_msgs/DiagnosticStatus").expect("a known type");
    let expected = "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n";
    assert!(text.starts_with(expected), "{text}");
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
    assert_eq!(arm["subscribing"], json!(["/joint_trajectory"]));
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
fn a_message_types_details_are_told_field_by_field_with_the_types_in_it() {
    let details = values(
        Rosapi::MessageDetails,
        json!({"type": "std_msgs/msg/Header"}),
    );
    assert_eq!(
        details,
        json!({"typedefs": [
            {
                "type": "std_msgs/Header",
                "fieldnames": ["stamp", "frame_id"],
                "fieldtypes": ["builtin_interfaces/Time", "string"],
                "fieldarraylen": [-1, -1],
                "examples": ["{}", ""],
                "constnames": [],
                "constvalues": [],
            },
            {
                "type": "builtin_interfaces/Time",
                "fieldnames": ["sec", "nanosec"],
                "fieldtypes": ["int32", "uint32"],
                "fieldarraylen": [-1, -1],
                "examples": ["0", "0"],
                "constnames": [],
                "constvalues": [],
            },
        ]})
    );
    let log = values(
        Rosapi::MessageDetails,
        json!({"type": "rcl_interfaces/Log"}),
    );
    let log = &log["typedefs"][0];
    assert_eq!(
        log["constnames"],
        json!(["DEBUG", "INFO", "WARN", "ERROR", "FATAL"])
    );
    assert_eq!(log["constvalues"], json!(["10", "20", "30", "40", "50"]));
    let state = values(
        Rosapi::MessageDetails,
        json!({"type": "pendularm_interfaces/TrialStatus"}),
    );
    let state = &state["typedefs"][0];
    assert_eq!(
        state["examples"],
        json!(["false", "0.0", "0.0", "0", "{}", "0.0", "[]", ""])
    );
    assert_eq!(
        state["fieldarraylen"],
        json!([-1, -1, -1, -1, -1, -1, 0, -1])
    );
}

/// The parts of a service and of an action are types of their own, named after the part.
#[test]
fn the_parts_of_services_and_actions_are_told_under_their_own_names() {
    let service = "pendularm_interfaces/srv/SendGoal";
    let action = "pendularm_interfaces/MoveTo";
    let goal = json!(["x", "y", "phi", "epsilon", "success_hold"]);
    for (question, type_name, name, fields, inside) in [
        (
            Rosapi::ServiceRequestDetails,
            service,
            "SendGoal_Request",
            goal.clone(),
            0,
        ),
        (
            Rosapi::ServiceResponseDetails,
            service,
            "SendGoal_Response",
            json!(["goal_id"]),
            0,
        ),
        (Rosapi::ActionGoalDetails, action, "MoveTo_Goal", goal, 0),
        (
            Rosapi::ActionResultDetails,
            action,
            "MoveTo_Result",
            json!(["goal_id", "outcome", "target", "final_distance"]),
            1,
        ),
        (
            Rosapi::ActionFeedbackDetails,
            action,
            "MoveTo_Feedback",
            json!([
                "goal_id",
                "target",
                "positions",
                "distance_remaining",
                "elapsed"
            ]),
            1,
        ),
    ] {
        let details = values(question, json!({"type": type_name}));
        let all = details["typedefs"].as_array().unwrap();
        assert_eq!(all.len(), 1 + inside, "{question:?}");
        assert_eq!(all[0]["type"], format!("pendularm_interfaces/{name}"));
        assert_eq!(all[0]["fieldnames"], fields);
        if inside == 1 {
            assert_eq!(all[1]["type"], "pendularm_interfaces/Target");
        }
    }
}

#[test]
fn a_type_that_is_not_known_is_refused_by_the_name_of_the_field() {
    for question in [
        Rosapi::MessageDetails,
        Rosapi::ServiceRequestDetails,
        Rosapi::ServiceResponseDetails,
        Rosapi::ActionGoalDetails,
        Rosapi::ActionResultDetails,
        Rosapi::ActionFeedbackDetails,
    ] {
        assert_eq!(
            asked(question, json!({"type": "demo/X"})),
            Err(AnswerError::UnknownType { field: "type" }),
            "{question:?}"
        );
    }
    let why = AnswerError::UnknownType { field: "type" }.to_string();
    assert_eq!(why, "type must name a type that this runtime knows");
    // A message is no service, and a service no action.
    let message = json!({"type": "std_msgs/msg/String"});
    assert!(asked(Rosapi::ServiceRequestDetails, message).is_err());
    let service = json!({"type": "pendularm_interfaces/srv/Solve"});
    assert!(asked(Rosapi::ActionGoalDetails, service).is_err());
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

#[test]
fn the_interfaces_are_all_types_of_messages_services_and_actions() {
    let found = values(Rosapi::Interfaces, json!({}));
    let found: Vec<&str> = found["interfaces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one.as_str().unwrap())
        .collect();
    let topics = Topic::ALL.map(Topic::type_name);
    let services = Service::ALL.map(Service::type_name);
    let questions = Rosapi::ALL.map(|question| Service::Rosapi(question).type_name());
    let player = Playback::ALL.map(|one| Service::Playback(one).type_name());
    let inside = [
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
        "builtin_interfaces/msg/Duration",
        "trajectory_msgs/msg/JointTrajectoryPoint",
        "diagnostic_msgs/msg/DiagnosticStatus",
        "diagnostic_msgs/msg/KeyValue",
        "pendularm_interfaces/msg/Target",
        "geometry_msgs/msg/TransformStamped",
        "geometry_msgs/msg/Transform",
        "geometry_msgs/msg/Vector3",
        "geometry_msgs/msg/Quaternion",
        "rosapi_msgs/msg/TypeDef",
        "actionlib_msgs/msg/GoalStatus",
        "control_msgs/msg/JointTolerance",
        "rcl_interfaces/msg/FloatingPointRange",
        "rcl_interfaces/msg/IntegerRange",
        "rcl_interfaces/msg/ListParametersResult",
        "rcl_interfaces/msg/Parameter",
        "rcl_interfaces/msg/ParameterDescriptor",
        "rcl_interfaces/msg/ParameterValue",
        "rcl_interfaces/msg/SetParametersResult",
        "tf2_web_republisher/msg/TFSubscriptionFeedback",
        "tf2_web_republisher/msg/TFSubscriptionGoal",
        "action_msgs/msg/GoalInfo",
        "action_msgs/msg/GoalStatus",
        "action_msgs/msg/GoalStatusArray",
        "control_msgs/msg/JointComponentTolerance",
        "geometry_msgs/msg/Twist",
        "pendularm_interfaces/msg/CriticalMode",
        "pendularm_interfaces/msg/Gains",
        "pendularm_interfaces/msg/Params",
        "service_msgs/msg/ServiceEventInfo",
        "trajectory_msgs/msg/MultiDOFJointTrajectory",
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint",
        "unique_identifier_msgs/msg/UUID",
    ];
    let actions = Action::ALL.map(Action::type_name);
    let mut expected: Vec<&str> = topics
        .into_iter()
        .chain(services)
        .chain(questions)
        .chain(player)
        .chain(inside)
        .chain(actions)
        .collect();
    expected.sort_unstable();
    // Two topics have frames, two have texts.
    expected.dedup();
    assert_eq!(found, expected);
}

#[test]
fn the_version_is_2_of_a_distribution_that_clients_know() {
    assert_eq!(
        values(Rosapi::GetRosVersion, json!({})),
        json!({"version": 2, "distro": "jazzy"})
    );
}
