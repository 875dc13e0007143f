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
use self::graph::{
    ServedRow, actions, named, node_details, node_name, node_names, services, topics,
};
pub use self::typedef::{TypeDef, asked_type};
use self::typedef::{details, interfaces};
use crate::protocol::catalog::{Node, Rosapi, Service, types};
use crate::protocol::names;

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
    let fields = Service::Rosapi(question).fields();
    let unknown = || AnswerError::UnknownType {
        field: fields.first().map_or("", |field| field.name),
    };
    let type_of = |rows| {
        let row = named(rows, asked);
        row.and_then(|row| row.type_name)
            .unwrap_or_default()
            .to_owned()
    };
    let listed = |rows: Vec<ServedRow<'_>>| -> Vec<String> {
        rows.into_iter().map(|row| row.name.into_owned()).collect()
    };
    let of_type = || -> Vec<ServedRow<'_>> {
        let rows = services(census).into_iter();
        rows.filter(|row| row.is_of(asked)).collect()
    };
    Ok(match question {
        Rosapi::Topics
        | Rosapi::TopicsAndRawTypes
        | Rosapi::TopicsForType
        | Rosapi::TopicType
        | Rosapi::Publishers
        | Rosapi::Subscribers => about_topics(question, asked, census),
        Rosapi::Services => json!({"services": listed(services(census))}),
        Rosapi::ServicesForType => json!({"services": listed(of_type())}),
        Rosapi::ServiceType => {
            json!({"type": type_of(services(census))})
        }
        Rosapi::ServiceNode => {
            let node = named(services(census), asked).map(|row| node_name(row.node));
            json!({"node": node.unwrap_or_default()})
        }
        Rosapi::ServiceProviders => {
            json!({"providers": node_names(of_type().iter().map(|row| &row.node))})
        }
        Rosapi::Nodes => json!({"nodes": Node::ALL.map(node_name)}),
        Rosapi::NodeDetails => node_details(asked, census),
        Rosapi::MessageDetails
        | Rosapi::ServiceRequestDetails
        | Rosapi::ServiceResponseDetails
        | Rosapi::ActionGoalDetails
        | Rosapi::ActionResultDetails
        | Rosapi::ActionFeedbackDetails => {
            json!({"typedefs": details(question, asked).ok_or_else(unknown)?})
        }
        Rosapi::ActionServers => json!({"action_servers": listed(actions(census))}),
        Rosapi::ActionType => {
            json!({"type": type_of(actions(census))})
        }
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

/// The `values` for a question about topics.
fn about_topics(question: Rosapi, asked: &str, census: &Census) -> Value {
    let rows = topics(census);
    let absolute = names::absolute(asked);
    let topic = rows.iter().find(|row| row.name == absolute);
    let (names, types): (Vec<_>, Vec<_>) = rows.iter().map(|row| (row.name, row.type_name)).unzip();
    match question {
        Rosapi::TopicsForType => {
            let of_type = rows.iter();
            let of_type = of_type.filter(|row| names::same_type(row.type_name, asked));
            json!({"topics": of_type.map(|row| row.name).collect::<Vec<_>>()})
        }
        Rosapi::TopicType => json!({"type": topic.map_or("", |row| row.type_name)}),
        Rosapi::Publishers => {
            json!({"publishers": node_names(topic.iter().flat_map(|row| &row.publishers))})
        }
        Rosapi::Subscribers => {
            json!({"subscribers": node_names(topic.iter().flat_map(|row| &row.subscribers))})
        }
        Rosapi::TopicsAndRawTypes => {
            // There are few types, but thousands of topics with them.
            let mut known = BTreeMap::new();
            for name in &types {
                let text = known.entry(*name);
                text.or_insert_with(|| types::full_text(name).unwrap_or_default());
            }
            let texts: Vec<_> = types.iter().filter_map(|name| known.get(name)).collect();
            json!({"topics": names, "types": types, "typedefs_full_text": texts})
        }
        _ => json!({"topics": names, "types": types}),
    }
}
