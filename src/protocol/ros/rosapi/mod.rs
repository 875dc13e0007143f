//! Answers to the questions of rosapi, from the catalog and from what clients have registered.
//!
//! Clients appear as the node `/gateway`, as they do behind any rosbridge. Questions for the arm (parameters, time) are
//! answered elsewhere.
//!
//! **Invariant:** what an answer lists is served: the lists are made from the catalog and the registry's own, for every
//! answer.

mod graph;
mod typedef;

use std::collections::BTreeMap;

use serde_json::{Value, json};

pub use self::graph::{Census, ListedService, ListedTopic, MAX_LISTED};
use self::graph::{Graph, node_name};
pub use self::typedef::TypeDef;
use self::typedef::{details, interfaces};
use crate::protocol::catalog::{Node, Rosapi, Service, types};

/// The ROS that all this looks like.
const ROS_VERSION: u8 = 2;
/// The distribution that the answer names: clients refuse one that they have not heard of, and the types and their
/// definitions here are those of this one.
pub(crate) const DISTRO: &str = "jazzy";

/// Why a question has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AnswerError {
    /// The catalog has no type of that name.
    #[error("{field} must name a type that this runtime knows")]
    UnknownType {
        /// The field that named it.
        field: &'static str,
    },
    /// The question is one that the arm answers.
    #[error("the arm was not asked")]
    OfTheArm,
}

/// The `values` that answer a question about `asked`, the name in its request; empty for one that has none.
///
/// # Errors
/// If it is about a type that is not known, or about something that the arm has.
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
            // Few types, but topics by the thousand that have them.
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
