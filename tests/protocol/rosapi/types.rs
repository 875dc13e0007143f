//! Questions about types: their texts, their details, and all of them.

use pendularm::protocol::catalog::{Action, Rosapi, Service, Topic, types};
use pendularm::protocol::ros::rosapi::AnswerError;
use serde_json::json;

use super::{asked, values};

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
fn the_interfaces_are_all_types_of_messages_services_and_actions() {
    let found = values(Rosapi::Interfaces, json!({}));
    let services = Service::ALL.map(Service::type_name);
    let questions = Rosapi::ALL.map(|question| Service::Rosapi(question).type_name());
    let actions = Action::ALL.map(Action::type_name);
    let messages = types::all().map(|one| one.name);
    let messages = messages.filter(|name| name.contains("/msg/"));
    let mut expected: Vec<&str> = messages
        .chain(services)
        .chain(questions)
        .chain(actions)
        .collect();
    expected.sort_unstable();
    expected.dedup();
    assert_eq!(found["interfaces"], json!(expected));
    for topic in Topic::ALL {
        assert!(expected.contains(&topic.type_name()), "{topic:?}");
    }
}
