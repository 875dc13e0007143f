//! The questions of rosapi: how clients of the ROS web world find out what there is.
//!
//! Each is served under `/rosapi/` and, as newer versions have it, under `/rosapi_node/`.
//!
//! **Invariant:** a question without an entry does not compile.

use super::services::ServiceEntry;
use super::{Field, Node, optional, required};

/// Where the questions stand.
pub const PREFIX: &str = "/rosapi/";
/// Where they stand too.
pub const PRIVATE_PREFIX: &str = "/rosapi_node/";

/// One question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rosapi {
    /// Every topic and its type.
    Topics,
    /// The topics of one type.
    TopicsForType,
    /// Every topic, its type, and the text that defines the type.
    TopicsAndRawTypes,
    /// The type of one topic.
    TopicType,
    /// The nodes that publish a topic.
    Publishers,
    /// The nodes that subscribe to a topic.
    Subscribers,
    /// Every service.
    Services,
    /// The services of one type.
    ServicesForType,
    /// The type of one service.
    ServiceType,
    /// The node that provides a service.
    ServiceNode,
    /// The nodes that provide a type of service.
    ServiceProviders,
    /// Every node.
    Nodes,
    /// What one node subscribes to, publishes and provides.
    NodeDetails,
    /// The fields of a message type, and of the types in it.
    MessageDetails,
    /// The fields of a request.
    ServiceRequestDetails,
    /// The fields of a response.
    ServiceResponseDetails,
    /// Every action.
    ActionServers,
    /// The type of one action.
    ActionType,
    /// The fields of a goal.
    ActionGoalDetails,
    /// The fields of a goal's result.
    ActionResultDetails,
    /// The fields of a goal's feedback.
    ActionFeedbackDetails,
    /// Every type that the runtime knows.
    Interfaces,
    /// The value of a parameter, as JSON text.
    GetParam,
    /// Sets a parameter.
    SetParam,
    /// Whether there is such a parameter.
    HasParam,
    /// Deletes a parameter: always refused.
    DeleteParam,
    /// Every parameter.
    GetParamNames,
    /// The simulation time.
    GetTime,
    /// Which ROS this looks like.
    GetRosVersion,
}

impl Rosapi {
    /// All questions, in the order in which they are documented.
    pub const ALL: [Self; 29] = [
        Self::Topics,
        Self::TopicsForType,
        Self::TopicsAndRawTypes,
        Self::TopicType,
        Self::Publishers,
        Self::Subscribers,
        Self::Services,
        Self::ServicesForType,
        Self::ServiceType,
        Self::ServiceNode,
        Self::ServiceProviders,
        Self::Nodes,
        Self::NodeDetails,
        Self::MessageDetails,
        Self::ServiceRequestDetails,
        Self::ServiceResponseDetails,
        Self::ActionServers,
        Self::ActionType,
        Self::ActionGoalDetails,
        Self::ActionResultDetails,
        Self::ActionFeedbackDetails,
        Self::Interfaces,
        Self::GetParam,
        Self::SetParam,
        Self::HasParam,
        Self::DeleteParam,
        Self::GetParamNames,
        Self::GetTime,
        Self::GetRosVersion,
    ];

    pub(super) const fn entry(self) -> &'static ServiceEntry {
        match self {
            Self::Topics => &TOPICS,
            Self::TopicsForType => &TOPICS_FOR_TYPE,
            Self::TopicsAndRawTypes => &TOPICS_AND_RAW_TYPES,
            Self::TopicType => &TOPIC_TYPE,
            Self::Publishers => &PUBLISHERS,
            Self::Subscribers => &SUBSCRIBERS,
            Self::Services => &SERVICES,
            Self::ServicesForType => &SERVICES_FOR_TYPE,
            Self::ServiceType => &SERVICE_TYPE,
            Self::ServiceNode => &SERVICE_NODE,
            Self::ServiceProviders => &SERVICE_PROVIDERS,
            Self::Nodes => &NODES,
            Self::NodeDetails => &NODE_DETAILS,
            Self::MessageDetails => &MESSAGE_DETAILS,
            Self::ServiceRequestDetails => &SERVICE_REQUEST_DETAILS,
            Self::ServiceResponseDetails => &SERVICE_RESPONSE_DETAILS,
            Self::ActionServers => &ACTION_SERVERS,
            Self::ActionType => &ACTION_TYPE,
            Self::ActionGoalDetails => &ACTION_GOAL_DETAILS,
            Self::ActionResultDetails => &ACTION_RESULT_DETAILS,
            Self::ActionFeedbackDetails => &ACTION_FEEDBACK_DETAILS,
            Self::Interfaces => &INTERFACES,
            Self::GetParam => &GET_PARAM,
            Self::SetParam => &SET_PARAM,
            Self::HasParam => &HAS_PARAM,
            Self::DeleteParam => &DELETE_PARAM,
            Self::GetParamNames => &GET_PARAM_NAMES,
            Self::GetTime => &GET_TIME,
            Self::GetRosVersion => &GET_ROS_VERSION,
        }
    }

    /// The question without a prefix: `topics`.
    #[must_use]
    pub fn short_name(self) -> &'static str {
        let name = self.entry().name;
        name.strip_prefix(PREFIX).unwrap_or(name)
    }

    /// The question of that service, under either prefix.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let short = name
            .strip_prefix(PREFIX)
            .or_else(|| name.strip_prefix(PRIVATE_PREFIX))?;
        Self::ALL
            .into_iter()
            .find(|question| question.short_name() == short)
    }
}

const fn question(
    name: &'static str,
    type_name: &'static str,
    request: &'static [Field],
    response: &'static [Field],
) -> ServiceEntry {
    ServiceEntry {
        name,
        type_name,
        owner: Node::Rosapi,
        request,
        response,
    }
}

const TYPEDEFS: [Field; 1] = [required("typedefs", "rosapi_msgs/msg/TypeDef[]", "")];
const DONE: [Field; 2] = [
    required("successful", "bool", ""),
    required("reason", "string", ""),
];

const TOPICS: ServiceEntry = question(
    "/rosapi/topics",
    "rosapi_msgs/srv/Topics",
    &[],
    &[
        required("topics", "string[]", ""),
        required("types", "string[]", ""),
    ],
);
const TOPICS_FOR_TYPE: ServiceEntry = question(
    "/rosapi/topics_for_type",
    "rosapi_msgs/srv/TopicsForType",
    &[required("type", "string", "")],
    &[required("topics", "string[]", "")],
);
const TOPICS_AND_RAW_TYPES: ServiceEntry = question(
    "/rosapi/topics_and_raw_types",
    "rosapi_msgs/srv/TopicsAndRawTypes",
    &[],
    &[
        required("topics", "string[]", ""),
        required("types", "string[]", ""),
        required("typedefs_full_text", "string[]", ""),
    ],
);
const TOPIC_TYPE: ServiceEntry = question(
    "/rosapi/topic_type",
    "rosapi_msgs/srv/TopicType",
    &[required("topic", "string", "")],
    &[required("type", "string", "")],
);
const PUBLISHERS: ServiceEntry = question(
    "/rosapi/publishers",
    "rosapi_msgs/srv/Publishers",
    &[required("topic", "string", "")],
    &[required("publishers", "string[]", "")],
);
const SUBSCRIBERS: ServiceEntry = question(
    "/rosapi/subscribers",
    "rosapi_msgs/srv/Subscribers",
    &[required("topic", "string", "")],
    &[required("subscribers", "string[]", "")],
);
const SERVICES: ServiceEntry = question(
    "/rosapi/services",
    "rosapi_msgs/srv/Services",
    &[],
    &[required("services", "string[]", "")],
);
const SERVICES_FOR_TYPE: ServiceEntry = question(
    "/rosapi/services_for_type",
    "rosapi_msgs/srv/ServicesForType",
    &[required("type", "string", "")],
    &[required("services", "string[]", "")],
);
const SERVICE_TYPE: ServiceEntry = question(
    "/rosapi/service_type",
    "rosapi_msgs/srv/ServiceType",
    &[required("service", "string", "")],
    &[required("type", "string", "")],
);
const SERVICE_NODE: ServiceEntry = question(
    "/rosapi/service_node",
    "rosapi_msgs/srv/ServiceNode",
    &[required("service", "string", "")],
    &[required("node", "string", "")],
);
const SERVICE_PROVIDERS: ServiceEntry = question(
    "/rosapi/service_providers",
    "rosapi_msgs/srv/ServiceProviders",
    &[required("service", "string", "")],
    &[required("providers", "string[]", "")],
);
const NODES: ServiceEntry = question(
    "/rosapi/nodes",
    "rosapi_msgs/srv/Nodes",
    &[],
    &[required("nodes", "string[]", "")],
);
const NODE_DETAILS: ServiceEntry = question(
    "/rosapi/node_details",
    "rosapi_msgs/srv/NodeDetails",
    &[required("node", "string", "")],
    &[
        required("subscribing", "string[]", ""),
        required("publishing", "string[]", ""),
        required("services", "string[]", ""),
    ],
);
const MESSAGE_DETAILS: ServiceEntry = question(
    "/rosapi/message_details",
    "rosapi_msgs/srv/MessageDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const SERVICE_REQUEST_DETAILS: ServiceEntry = question(
    "/rosapi/service_request_details",
    "rosapi_msgs/srv/ServiceRequestDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const SERVICE_RESPONSE_DETAILS: ServiceEntry = question(
    "/rosapi/service_response_details",
    "rosapi_msgs/srv/ServiceResponseDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const ACTION_SERVERS: ServiceEntry = question(
    "/rosapi/action_servers",
    "rosapi_msgs/srv/GetActionServers",
    &[],
    &[required("action_servers", "string[]", "")],
);
const ACTION_TYPE: ServiceEntry = question(
    "/rosapi/action_type",
    "rosapi_msgs/srv/ActionType",
    &[required("action", "string", "")],
    &[required("type", "string", "")],
);
const ACTION_GOAL_DETAILS: ServiceEntry = question(
    "/rosapi/action_goal_details",
    "rosapi_msgs/srv/ActionGoalDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const ACTION_RESULT_DETAILS: ServiceEntry = question(
    "/rosapi/action_result_details",
    "rosapi_msgs/srv/ActionResultDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const ACTION_FEEDBACK_DETAILS: ServiceEntry = question(
    "/rosapi/action_feedback_details",
    "rosapi_msgs/srv/ActionFeedbackDetails",
    &[required("type", "string", "")],
    &TYPEDEFS,
);
const INTERFACES: ServiceEntry = question(
    "/rosapi/interfaces",
    "rosapi_msgs/srv/Interfaces",
    &[],
    &[required("interfaces", "string[]", "")],
);
const GET_PARAM: ServiceEntry = question(
    "/rosapi/get_param",
    "rosapi_msgs/srv/GetParam",
    &[
        required("name", "string", ""),
        optional("default_value", "string", ""),
    ],
    &[
        required("value", "string", ""),
        required("successful", "bool", ""),
        required("reason", "string", ""),
    ],
);
const SET_PARAM: ServiceEntry = question(
    "/rosapi/set_param",
    "rosapi_msgs/srv/SetParam",
    &[
        required("name", "string", ""),
        required("value", "string", ""),
    ],
    &DONE,
);
const HAS_PARAM: ServiceEntry = question(
    "/rosapi/has_param",
    "rosapi_msgs/srv/HasParam",
    &[required("name", "string", "")],
    &[required("exists", "bool", "")],
);
const DELETE_PARAM: ServiceEntry = question(
    "/rosapi/delete_param",
    "rosapi_msgs/srv/DeleteParam",
    &[required("name", "string", "")],
    &DONE,
);
const GET_PARAM_NAMES: ServiceEntry = question(
    "/rosapi/get_param_names",
    "rosapi_msgs/srv/GetParamNames",
    &[],
    &[required("names", "string[]", "")],
);
const GET_TIME: ServiceEntry = question(
    "/rosapi/get_time",
    "rosapi_msgs/srv/GetTime",
    &[],
    &[required("time", "builtin_interfaces/msg/Time", "s, ns")],
);
const GET_ROS_VERSION: ServiceEntry = question(
    "/rosapi/get_ros_version",
    "rosapi_msgs/srv/GetROSVersion",
    &[],
    &[
        required("version", "uint8", ""),
        required("distro", "string", ""),
    ],
);
