//! The services of rosapi, by which ROS web clients list topics, services and types. One row each.
//!
//! Each is served under `/rosapi/` and, as in newer versions, under `/rosapi_node/`.
//!
//! **Invariant:** every row has a name under [`PREFIX`]. The other spelling is derived from it.

use super::entry::{Field, ServiceEntry, fields, service};
use super::node::Node;
use super::table::table;
use super::topics::ARM_STATE;

/// The prefix of the services' names.
pub const PREFIX: &str = "/rosapi/";
/// The prefix of their other names.
pub const PRIVATE_PREFIX: &str = "/rosapi_node/";

table! {
    /// One service.
    pub enum Rosapi of ServiceEntry {
        /// Every topic and its type.
        Topics = question("/rosapi/topics", "rosapi_msgs/srv/Topics")
            .response(fields!["string[] topics", "string[] types"]),
        /// The topics of one type.
        TopicsForType = question("/rosapi/topics_for_type", "rosapi_msgs/srv/TopicsForType")
            .request(fields!["string type"])
            .response(fields!["string[] topics"]),
        /// Every topic, its type, and the text that defines the type.
        TopicsAndRawTypes = question("/rosapi/topics_and_raw_types", "rosapi_msgs/srv/TopicsAndRawTypes")
            .response(fields!["string[] topics", "string[] types", "string[] typedefs_full_text"]),
        /// The type of one topic.
        TopicType = question("/rosapi/topic_type", "rosapi_msgs/srv/TopicType")
            .request(fields!["string topic"])
            .response(fields!["string type"]),
        /// The nodes that publish a topic.
        Publishers = question("/rosapi/publishers", "rosapi_msgs/srv/Publishers")
            .request(fields!["string topic"])
            .response(fields!["string[] publishers"]),
        /// The nodes that subscribe to a topic.
        Subscribers = question("/rosapi/subscribers", "rosapi_msgs/srv/Subscribers")
            .request(fields!["string topic"])
            .response(fields!["string[] subscribers"]),
        /// Every service.
        Services = question("/rosapi/services", "rosapi_msgs/srv/Services")
            .response(fields!["string[] services"]),
        /// The services of one type.
        ServicesForType = question("/rosapi/services_for_type", "rosapi_msgs/srv/ServicesForType")
            .request(fields!["string type"])
            .response(fields!["string[] services"]),
        /// The type of one service.
        ServiceType = question("/rosapi/service_type", "rosapi_msgs/srv/ServiceType")
            .request(fields!["string service"])
            .response(fields!["string type"]),
        /// The node that provides a service.
        ServiceNode = question("/rosapi/service_node", "rosapi_msgs/srv/ServiceNode")
            .request(fields!["string service"])
            .response(fields!["string node"]),
        /// The nodes that provide a type of service.
        ServiceProviders = question("/rosapi/service_providers", "rosapi_msgs/srv/ServiceProviders")
            .request(fields!["string service"])
            .response(fields!["string[] providers"]),
        /// Every node.
        Nodes = question("/rosapi/nodes", "rosapi_msgs/srv/Nodes")
            .response(fields!["string[] nodes"]),
        /// The topics and services of one node.
        NodeDetails = question("/rosapi/node_details", "rosapi_msgs/srv/NodeDetails")
            .request(fields!["string node"])
            .response(fields!["string[] subscribing", "string[] publishing", "string[] services"]),
        /// The fields of a message type, and of the types in it.
        MessageDetails = question("/rosapi/message_details", "rosapi_msgs/srv/MessageDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// The fields of a request.
        ServiceRequestDetails = question("/rosapi/service_request_details", "rosapi_msgs/srv/ServiceRequestDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// The fields of a response.
        ServiceResponseDetails = question("/rosapi/service_response_details", "rosapi_msgs/srv/ServiceResponseDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// Every action.
        ActionServers = question("/rosapi/action_servers", "rosapi_msgs/srv/GetActionServers")
            .response(fields!["string[] action_servers"]),
        /// The type of one action.
        ActionType = question("/rosapi/action_type", "rosapi_msgs/srv/ActionType")
            .request(fields!["string action"])
            .response(fields!["string type"]),
        /// The fields of a goal.
        ActionGoalDetails = question("/rosapi/action_goal_details", "rosapi_msgs/srv/ActionGoalDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// The fields of a goal's result.
        ActionResultDetails = question("/rosapi/action_result_details", "rosapi_msgs/srv/ActionResultDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// The fields of a goal's feedback.
        ActionFeedbackDetails = question("/rosapi/action_feedback_details", "rosapi_msgs/srv/ActionFeedbackDetails")
            .request(fields!["string type"])
            .response(TYPEDEFS),
        /// Every type that the runtime knows.
        Interfaces = question("/rosapi/interfaces", "rosapi_msgs/srv/Interfaces")
            .response(fields!["string[] interfaces"]),
        /// The value of a parameter, as JSON text.
        GetParam = question("/rosapi/get_param", "rosapi_msgs/srv/GetParam")
            .request(fields!["string name", "string default_value?"])
            .response(fields!["string value", "bool successful", "string reason"]),
        /// Sets a parameter.
        SetParam = question("/rosapi/set_param", "rosapi_msgs/srv/SetParam")
            .request(fields!["string name", "string value"])
            .response(DONE)
            .supersedes(ARM_STATE),
        /// Whether the parameter exists.
        HasParam = question("/rosapi/has_param", "rosapi_msgs/srv/HasParam")
            .request(fields!["string name"])
            .response(fields!["bool exists"]),
        /// Deletes a parameter: always refused.
        DeleteParam = question("/rosapi/delete_param", "rosapi_msgs/srv/DeleteParam")
            .request(fields!["string name"])
            .response(DONE),
        /// Every parameter.
        GetParamNames = question("/rosapi/get_param_names", "rosapi_msgs/srv/GetParamNames")
            .response(fields!["string[] names"]),
        /// The simulation time.
        GetTime = question("/rosapi/get_time", "rosapi_msgs/srv/GetTime")
            .response(fields!["builtin_interfaces/msg/Time time  # s, ns"]),
        /// The ROS version that this runtime reports.
        GetRosVersion = question("/rosapi/get_ros_version", "rosapi_msgs/srv/GetROSVersion")
            .response(fields!["uint8 version", "string distro"]),
    }
}

const fn question(name: &'static str, type_name: &'static str) -> ServiceEntry {
    service(name, type_name, Node::Rosapi)
}

const TYPEDEFS: &[Field] = fields!["rosapi_msgs/msg/TypeDef[] typedefs"];
const DONE: &[Field] = fields!["bool successful", "string reason",];

impl Rosapi {
    /// Whether it is about the arm's parameters.
    #[must_use]
    pub const fn is_about_parameters(self) -> bool {
        matches!(
            self,
            Self::GetParam
                | Self::SetParam
                | Self::HasParam
                | Self::DeleteParam
                | Self::GetParamNames
        )
    }

    /// The question without a prefix: `topics`.
    #[must_use]
    pub fn short_name(self) -> &'static str {
        let name = self.entry().name;
        name.strip_prefix(PREFIX).unwrap_or(name)
    }

    /// The row of that service, under either prefix.
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
