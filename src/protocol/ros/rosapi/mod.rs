//! Answers of rosapi's services, from the catalog and the clients' registrations.
//!
//! Clients appear as the node `/gateway`, as in other rosbridge servers. Calls for the arm (parameters, time) are
//! answered elsewhere.
//!
//! **Invariant:** every listed entry is served. The lists are made from the catalog and the registry for every answer.

mod graph;
mod typedef;

use std::collections::BTreeMap;

use serde_json::{Value, json};

pub use self::graph::{Census, ListedService, ListedTopic, MAX_LISTED};
use self::graph::{Graph, node_name};
pub use self::typedef::TypeDef;
use self::typedef::{details, interfaces};
use crate::protocol::catalog::{Node, Rosapi, Service, types};

/// The reported ROS version.
const ROS_VERSION: u8 = 2;
/// The reported distribution. Clients refuse unknown ones. The types here and their definitions are those of this
/// distribution.
pub(crate) const DISTRO: &str = "jazzy";

/// Why a call has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AnswerError {
    /// The catalog has no type of that name.
    #[error("{field} must name a type that this runtime knows")]
    UnknownType {
        /// The field that named it.
        field: &'static str,
    },
    /// The call is for the arm.
    #[error("the arm was not asked")]
    OfTheArm,
}

/// The `values` for a call about `asked`, the name in its request; `asked` is empty if the request has no name.
///
/// # Errors
/// If the type is unknown, or if the call is for the arm.
pub fn answer(question: Rosapi, asked: &str, census: &Census) -> Result<Value, AnswerError> {
    let graph = Graph { census };
    let fields = Service::Rosapi(question).fields();
    let unknown = || AnswerError::UnknownType {
        field: fields.first().map_or("", |field| field.name),
    };
    Ok(match question {
        Rosapi::Topics => {
            let (topics, types) = graph.topics();
            json!({"topics": topics, "types": types})
        }
        Rosapi::TopicsForType => json!({"topics": graph.topics_of(asked)}),
        Rosapi::TopicsAndRawTypes => {
            let (topics, types) = graph.topics();
            // There are few types, but thousands of topics with them.
            let mut known = BTreeMap::new();
            for name in &types {
                let text = known.entry(name.as_str());
                text.or_insert_with(|| types::full_text(name).unwrap_or_default());
            }
            let text = |name: &String| known.get(name.as_str());
            let texts: Vec<_> = types.iter().filter_map(text).collect();
            json!({"topics": topics, "types": types, "typedefs_full_text": texts})
        }
        Rosapi::TopicType => json!({"type": graph.topic_type(asked)}),
        Rosapi::Publishers => json!({"publishers": graph.publishers(asked)}),
        Rosapi::Subscribers => json!({"subscribers": graph.subscribers(asked)}),
        Rosapi::Services => json!({"services": graph.services()}),
        Rosapi::ServicesForType => json!({"services": graph.services_of(asked)}),
        Rosapi::ServiceType => json!({"type": graph.service(asked).0}),
        Rosapi::ServiceNode => json!({"node": graph.service(asked).1}),
        Rosapi::ServiceProviders => json!({"providers": graph.providers(asked)}),
        Rosapi::Nodes => json!({"nodes": Node::ALL.map(node_name)}),
        Rosapi::NodeDetails => graph.node_details(asked),
        Rosapi::MessageDetails
        | Rosapi::ServiceRequestDetails
        | Rosapi::ServiceResponseDetails
        | Rosapi::ActionGoalDetails
        | Rosapi::ActionResultDetails
        | Rosapi::ActionFeedbackDetails => {
            json!({"typedefs": details(question, asked).ok_or_else(unknown)?})
        }
        Rosapi::ActionServers => json!({"action_servers": graph.actions()}),
        Rosapi::ActionType => json!({"type": graph.action_type(asked)}),
        Rosapi::Interfaces => json!({"interfaces": interfaces()}),
        Rosapi::GetRosVersion => json!({"version": ROS_VERSION, "distro": DISTRO}),
        Rosapi::GetParam
        | Rosapi::SetParam
        | Rosapi::HasParam
        | Rosapi::DeleteParam
        | Rosapi::GetParamNames
        | Rosapi::GetTime => {
            debug_assert!(false, "{question:?} is a question to the arm");
            return Err(AnswerError::OfTheArm);
        }
    })
}
