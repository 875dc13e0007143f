//! The list of topics and services agrees with the tables of docs/protocol.md, and with itself.
//!
//! **Invariant:** names are spelled here as the paper spells them, not taken from the catalog.

use std::collections::HashSet;

use pendularm::protocol::catalog::{Direction, Field, Node, Service, Topic, types};

fn names(fields: &[Field]) -> Vec<&'static str> {
    fields.iter().map(|field| field.name).collect()
}

fn required(fields: &[Field]) -> Vec<&'static str> {
    fields
        .iter()
        .filter(|field| field.required)
        .map(|field| field.name)
        .collect()
}

/// The tables under "Services" in docs/protocol.md: service, request, values.
const SERVICES: &[(&str, &[&str], &[&str])] = &[
    (
        "/arm_sim/integration_step",
        &["function", "x0", "xdot0", "dt", "steps", "integrator"],
        &["times", "positions", "velocities"],
    ),
    (
        "/arm_sim/set_integrator",
        &["method", "timestep"],
        &["method", "timestep"],
    ),
    (
        "/arm_sim/set_params",
        &["gravity", "masses", "lengths"],
        &["gravity", "masses", "lengths"],
    ),
    ("/arm_sim/pause", &["data"], &["data"]),
    ("/arm_sim/reset", &[], &["position", "velocity"]),
    ("/arm_sim/step", &["steps"], &["steps", "time"]),
    (
        "/arm_sim/disturb",
        &["effort", "duration"],
        &["effort", "duration"],
    ),
    (
        "/arm_sim/list_parameters",
        &["prefixes", "depth"],
        &["result"],
    ),
    ("/arm_sim/get_parameters", &["names"], &["values"]),
    ("/arm_sim/get_parameter_types", &["names"], &["types"]),
    ("/arm_sim/describe_parameters", &["names"], &["descriptors"]),
    ("/arm_sim/set_parameters", &["parameters"], &["results"]),
    ("/pid_controller/enable", &["data"], &["data"]),
    (
        "/pid_controller/set_gains",
        &["kp", "ki", "kd"],
        &["kp", "ki", "kd"],
    ),
    ("/ik/solve", &["x", "y", "phi"], &["positions"]),
    (
        "/ik_action/send_goal",
        &["x", "y", "phi", "epsilon", "success_hold"],
        &["goal_id"],
    ),
    ("/ik_action/cancel_goal", &["goal_id"], &[]),
    (
        "/ik_trial/start",
        &["duration", "epsilon", "success_hold"],
        &["duration", "epsilon", "success_hold"],
    ),
    ("/ik_trial/skip", &[], &[]),
    ("/ik_trial/stop", &[], &[]),
    (
        "/republish_tfs",
        &[
            "source_frames",
            "target_frame",
            "angular_thres",
            "trans_thres",
            "rate",
            "timeout",
        ],
        &["topic_name"],
    ),
    (
        "/study/stability",
        &["integrator", "gains", "params", "setpoint"],
        &[
            "timestep_limit_held",
            "timestep_limit_continuous",
            "equilibrium",
            "equilibrium_kind",
            "minimum_over_poses_held",
            "minimum_over_poses_continuous",
            "minimum_over_poses_bound",
            "certified",
            "worst_pose",
            "critical",
            "timestep_limit_motion",
            "motion_speed",
            "advised_timestep",
        ],
    ),
    (
        "/study/rollout",
        &[
            "q0",
            "qdot0",
            "duration",
            "timestep",
            "integrator",
            "params",
            "gains",
            "setpoint",
            "samples",
            "reference",
        ],
        &[
            "times",
            "positions",
            "velocities",
            "efforts",
            "energy",
            "evaluations",
            "wall_time",
            "error",
            "error_uncertainty",
        ],
    ),
    (
        "/study/gains",
        &[
            "settling_time",
            "margin",
            "timestep",
            "integrator",
            "params",
        ],
        &[
            "kp",
            "ki",
            "kd",
            "timestep_limit",
            "certified",
            "margin",
            "settled_after",
        ],
    ),
    (
        "/study/plan",
        &[
            "error", "duration", "servo", "q0", "qdot0", "params", "gains", "setpoint",
        ],
        &[
            "integrator",
            "timestep",
            "control_period",
            "evaluations_per_second",
            "error",
            "error_uncertainty",
            "methods",
            "timesteps",
            "evaluations",
            "errors",
        ],
    ),
    ("/recorder/start", &["name"], &["file"]),
    (
        "/recorder/stop",
        &[],
        &["file", "messages", "bytes", "dropped"],
    ),
];

#[test]
fn the_services_are_those_of_the_paper() {
    let listed: Vec<_> = Service::ALL
        .iter()
        .map(|service| {
            (
                service.name(),
                names(service.fields()),
                names(service.response_fields()),
            )
        })
        .collect();
    let expected: Vec<_> = SERVICES
        .iter()
        .map(|(name, request, values)| (*name, request.to_vec(), values.to_vec()))
        .collect();
    assert_eq!(listed, expected);
}

/// Name, type, and which way it goes.
const TOPICS: &[(&str, &str, Direction)] = {
    use Direction::{Published, Subscribed};
    &[
        (
            "/joint_trajectory",
            "trajectory_msgs/msg/JointTrajectory",
            Subscribed,
        ),
        ("/joint_states", "sensor_msgs/msg/JointState", Published),
        ("/clock", "rosgraph_msgs/msg/Clock", Published),
        (
            "/diagnostics",
            "diagnostic_msgs/msg/DiagnosticArray",
            Published,
        ),
        (
            "/ik_action/feedback",
            "pendularm_interfaces/msg/IkFeedback",
            Published,
        ),
        (
            "/ik_action/result",
            "pendularm_interfaces/msg/IkResult",
            Published,
        ),
        (
            "/ik_trial/status",
            "pendularm_interfaces/msg/TrialStatus",
            Published,
        ),
        ("/tf", "tf2_msgs/msg/TFMessage", Published),
        ("/tf_static", "tf2_msgs/msg/TFMessage", Published),
        (
            "/tf2_web_republisher/frames",
            "tf2_web_republisher/msg/TFArray",
            Published,
        ),
        (
            "/tf2_web_republisher/goal",
            "tf2_web_republisher/msg/TFSubscriptionActionGoal",
            Subscribed,
        ),
        (
            "/tf2_web_republisher/cancel",
            "actionlib_msgs/msg/GoalID",
            Subscribed,
        ),
        (
            "/tf2_web_republisher/feedback",
            "tf2_web_republisher/msg/TFSubscriptionActionFeedback",
            Published,
        ),
        ("/robot_description", "std_msgs/msg/String", Published),
        (
            "/robot_description_semantic",
            "std_msgs/msg/String",
            Published,
        ),
        ("/rosout", "rcl_interfaces/msg/Log", Published),
        (
            "/arm_sim/error_estimate",
            "pendularm_interfaces/msg/ErrorEstimate",
            Published,
        ),
    ]
};

#[test]
fn the_topics_are_those_of_the_paper() {
    let listed: Vec<_> = Topic::ALL
        .iter()
        .map(|topic| (topic.name(), topic.type_name(), topic.direction()))
        .collect();
    assert_eq!(listed, TOPICS);
}

#[test]
fn required_fields_are_those_that_have_no_default() {
    for service in Service::ALL {
        let expected: &[&str] = match service {
            Service::IntegrationStep => &["function", "x0", "dt", "steps", "integrator"],
            Service::Solve | Service::SendGoal => &["x", "y"],
            Service::Step => &["steps"],
            Service::Disturb => &["effort", "duration"],
            Service::Plan => &["error"],
            Service::GetParameters | Service::GetParameterTypes | Service::DescribeParameters => {
                &["names"]
            }
            Service::SetParameters => &["parameters"],
            _ => &[],
        };
        assert_eq!(required(service.fields()), expected, "{}", service.name());
    }
}

#[test]
fn five_services_compute_and_those_with_one_purpose_take_all_or_nothing() {
    let of = |chosen: fn(Service) -> bool| -> Vec<Service> {
        Service::ALL
            .into_iter()
            .filter(|&service| chosen(service))
            .collect()
    };
    assert_eq!(
        of(Service::is_computation),
        [
            Service::IntegrationStep,
            Service::Stability,
            Service::Rollout,
            Service::SuggestGains,
            Service::Plan
        ]
    );
    assert_eq!(
        of(Service::all_or_nothing),
        [
            Service::IntegrationStep,
            Service::Step,
            Service::Disturb,
            Service::ListParameters,
            Service::GetParameters,
            Service::GetParameterTypes,
            Service::DescribeParameters,
            Service::SetParameters,
            Service::Solve,
            Service::SendGoal,
            Service::CancelGoal,
            Service::TrialStart,
            Service::RepublishTfs,
            Service::Stability,
            Service::Rollout,
            Service::SuggestGains,
            Service::Plan,
            Service::RecorderStart
        ]
    );
}

/// A topic that changes seldom has to reach those that come late.
#[test]
fn the_fixed_frames_and_the_descriptions_are_latched_and_nothing_else_is() {
    let latched: Vec<_> = Topic::ALL
        .into_iter()
        .filter(|topic| topic.is_latched())
        .collect();
    let lasting = [
        Topic::TfStatic,
        Topic::RobotDescription,
        Topic::RobotSemantics,
    ];
    assert_eq!(latched, lasting);
}

#[test]
fn gains_and_params_have_the_members_that_their_services_have_as_fields() {
    for service in [Service::Stability, Service::Rollout] {
        for field in service.fields() {
            let members = match field.name {
                "gains" => Service::SetGains.fields(),
                "params" => Service::SetParams.fields(),
                _ => &[],
            };
            assert_eq!(field.members(), members, "{field:?}");
        }
    }
}

#[test]
fn a_name_leads_back_to_what_it_names() {
    for topic in Topic::ALL {
        assert_eq!(Topic::from_name(topic.name()), Some(topic));
        assert_eq!(Topic::from_name(topic.short_name()), Some(topic));
        assert_eq!(Service::from_name(topic.name()), None);
    }
    for service in Service::ALL {
        assert_eq!(Service::from_name(service.name()), Some(service));
        assert_eq!(Topic::from_name(service.name()), None);
    }
    for other in ["", "/", "//joint_states", "/joint_states/", "/arm_sim"] {
        assert_eq!(Topic::from_name(other), None);
        assert_eq!(Service::from_name(other), None);
    }
}

#[test]
fn names_and_types_are_given_once_and_in_the_form_that_ros_gives_them() {
    let topics = Topic::ALL.map(|topic| (topic.name(), topic.type_name(), "msg"));
    let services = Service::ALL.map(|service| (service.name(), service.type_name(), "srv"));
    let mut seen = HashSet::new();
    for (name, type_name, kind) in topics.into_iter().chain(services) {
        // Frames that move and frames that do not have one type, and so have all texts.
        let shares = ["/tf_static", "/robot_description_semantic"].contains(&name);
        assert!(
            seen.insert(name) && (seen.insert(type_name) || shares),
            "{name} or {type_name} is listed twice"
        );
        let parts: Vec<&str> = type_name.split('/').collect();
        assert!(
            matches!(parts[..], [_, middle, _] if middle == kind),
            "{type_name}"
        );
    }
}

#[test]
fn a_field_is_listed_once_and_numbers_have_a_unit() {
    let topics = Topic::ALL.into_iter().map(Topic::fields);
    let requests = Service::ALL.into_iter().map(Service::fields);
    let responses = Service::ALL.into_iter().map(Service::response_fields);
    for fields in topics.chain(requests).chain(responses) {
        let distinct: HashSet<&str> = fields.iter().map(|field| field.name).collect();
        assert_eq!(distinct.len(), fields.len(), "{fields:?}");
        for field in fields
            .iter()
            .filter(|field| field.kind.starts_with("float64"))
        {
            assert!(!field.unit.is_empty(), "{field:?}");
        }
    }
}

#[test]
fn a_type_is_found_with_and_without_its_middle_part_and_with_no_other() {
    for one in types::all() {
        let found = |name: &str| types::find(name).map(|found| found.name);
        let [package, middle, last] = one.name.split('/').collect::<Vec<_>>()[..] else {
            panic!("{}", one.name);
        };
        assert_eq!(found(one.name), Some(one.name));
        assert_eq!(found(&format!("{package}/{last}")), Some(one.name));
        for other in ["srv", "action", ""].map(|part| format!("{package}/{part}/{last}")) {
            let is_other = middle != other.split('/').nth(1).unwrap_or_default();
            assert!(!is_other || found(&other).is_none(), "{other}");
        }
        assert_eq!(found(&format!("{}/", one.name)), None);
    }
}

/// Messages are encoded by walking through their types: that has to come to an end.
#[test]
fn no_type_has_itself_inside() {
    fn walk(one: types::Type, above: &mut Vec<&'static str>) {
        assert!(!above.contains(&one.name), "{above:?}: {}", one.name);
        above.push(one.name);
        for field in one.fields {
            if let Some(inside) = types::find(field.element().0) {
                walk(inside, above);
            }
        }
        above.pop();
    }
    for one in types::all() {
        walk(one, &mut Vec::new());
    }
}

#[test]
fn every_node_has_a_name_of_its_own() {
    let names: HashSet<&str> = Node::ALL.iter().map(|node| node.name()).collect();
    assert_eq!(
        names,
        HashSet::from([
            "arm_sim",
            "ik",
            "ik_action",
            "ik_trial",
            "joint_trajectory_controller",
            "study",
            "tf2_web_republisher",
            "recorder",
            "gateway",
            "rosapi"
        ])
    );
    assert_eq!(Topic::JointStates.owner(), Node::ArmSim);
    assert_eq!(Service::TrialStop.owner(), Node::IkTrial);
}
