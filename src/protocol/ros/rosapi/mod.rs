//! Answers of rosapi's services, from the catalog and the clients' registrations.
//!
//! Clients appear as the node `/gateway`, as in other rosbridge servers. Calls for the arm (parameters, time) are
//! answered elsewhere.
//!
//! **Invariant:** every listed entry is served. The lists are made from the catalog and the registry for every answer.

mod graph;
mod typedef;

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

pub use self::graph::{Census, Listed, MAX_LISTED};
use self::graph::{Row, actions, are_same_type, node_name, services, topics};
pub use self::typedef::asked_type;
use self::typedef::{details, interfaces};
use crate::protocol::catalog::{Node, Rosapi, Service, types};
use crate::protocol::names;

/// The reported ROS version.
const ROS_VERSION: u8 = 2;
/// The reported distribution. Clients refuse unknown ones. The types here and their definitions are those of this
/// distribution.
pub(crate) const DISTRO: &str = "jazzy";

/// The catalog has no type of the name in this field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} must name a type that this runtime knows")]
pub struct UnknownType(pub &'static str);

/// The `values` for a call about `asked`, the name in its request; `asked` is empty if the request has no name.
///
/// # Errors
/// If the type is unknown.
pub fn answer(question: Rosapi, asked: &str, census: &Census) -> Result<Value, UnknownType> {
    let service = Service::Rosapi(question);
    let rows = match question {
        Rosapi::Topics
        | Rosapi::TopicsAndRawTypes
        | Rosapi::TopicsForType
        | Rosapi::TopicType
        | Rosapi::Publishers
        | Rosapi::Subscribers => topics(census),
        Rosapi::ActionServers | Rosapi::ActionType => actions(census),
        _ => services(census),
    };
    let name = names::absolute(asked);
    let found = rows.iter().find(|row| row.name == name);
    let all = || rows.iter().map(|row| &*row.name).collect();
    let types = || rows.iter().map(|row| row.type_name).collect();
    let of_type = || {
        let rows = rows.iter();
        rows.filter(|row| are_same_type(row.type_name, asked))
    };
    // In the order of the catalog's fields.
    let values: Vec<Value> = match question {
        Rosapi::Topics => vec![all(), types()],
        Rosapi::TopicsAndRawTypes => vec![all(), types(), definitions(&rows)],
        Rosapi::Services | Rosapi::ActionServers => vec![all()],
        Rosapi::TopicsForType | Rosapi::ServicesForType => {
            vec![of_type().map(|row| &*row.name).collect()]
        }
        Rosapi::TopicType | Rosapi::ServiceType | Rosapi::ActionType => {
            vec![found.map_or("", |row| row.type_name).into()]
        }
        Rosapi::Publishers => vec![node_names(found.iter().flat_map(|row| &row.publishers))],
        Rosapi::Subscribers => vec![node_names(found.iter().flat_map(|row| &row.subscribers))],
        Rosapi::ServiceProviders => vec![node_names(of_type().flat_map(|row| &row.publishers))],
        Rosapi::ServiceNode => {
            let node = found.and_then(|row| row.publishers.first());
            vec![node.copied().map(node_name).unwrap_or_default().into()]
        }
        Rosapi::Nodes => vec![Node::ALL.map(node_name).into_iter().collect()],
        Rosapi::NodeDetails => node_details(asked, &topics(census), &rows),
        Rosapi::MessageDetails
        | Rosapi::ServiceRequestDetails
        | Rosapi::ServiceResponseDetails
        | Rosapi::ActionGoalDetails
        | Rosapi::ActionResultDetails
        | Rosapi::ActionFeedbackDetails => {
            let field = service.fields().first().map_or("", |field| field.name);
            vec![details(question, asked).ok_or(UnknownType(field))?]
        }
        Rosapi::Interfaces => vec![interfaces().into_iter().collect()],
        Rosapi::GetRosVersion => vec![ROS_VERSION.into(), DISTRO.into()],
        Rosapi::GetParam
        | Rosapi::SetParam
        | Rosapi::HasParam
        | Rosapi::DeleteParam
        | Rosapi::GetParamNames
        | Rosapi::GetTime => {
            debug_assert!(false, "{question:?} is a question to the arm");
            vec![]
        }
    };
    let names = service.response_fields().iter();
    let names = names.map(|field| field.name.to_owned());
    Ok(Value::Object(names.zip(values).collect()))
}

/// The topics and services of a node. All lists are empty if there is no such node.
fn node_details(name: &str, topics: &[Row<'_>], services: &[Row<'_>]) -> Vec<Value> {
    let name = names::relative(name);
    let is_meant = |nodes: &[Node]| nodes.iter().any(|node| node.name() == name);
    let subscribing = topics.iter().filter(|row| is_meant(&row.subscribers));
    let publishing = topics.iter().filter(|row| is_meant(&row.publishers));
    let services = services.iter().filter(|row| is_meant(&row.publishers));
    vec![
        json!(subscribing.map(|row| &row.name).collect::<BTreeSet<_>>()),
        json!(publishing.map(|row| &row.name).collect::<BTreeSet<_>>()),
        services.map(|row| &*row.name).collect(),
    ]
}

/// The names of nodes, each once.
fn node_names<'a>(nodes: impl IntoIterator<Item = &'a Node>) -> Value {
    let names: BTreeSet<String> = nodes.into_iter().map(|node| node_name(*node)).collect();
    json!(names)
}

/// The text that defines each row's type. There are few types, but thousands of topics with them.
fn definitions(rows: &[Row<'_>]) -> Value {
    let mut known = BTreeMap::new();
    let text = |row: &Row<'_>| {
        let text = known.entry(row.type_name.to_owned());
        let text = text.or_insert_with_key(|name| types::full_text(name).unwrap_or_default());
        text.clone()
    };
    rows.iter().map(text).collect()
}
