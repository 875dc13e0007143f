//! The graph of nodes, topics and services, from the catalog and from clients.
//!
//! **Invariant:** the runtime's entries come first, in the order of the documentation. Clients appear as the
//! node `/gateway`.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::protocol::catalog::rosapi::{PREFIX, PRIVATE_PREFIX};
use crate::protocol::catalog::{Action, Direction, Node, Rosapi, Service, Topic};
use crate::protocol::names;

/// Most topics of clients in one answer, and most services: more than a screen shows. The first by name are listed.
pub const MAX_LISTED: usize = 4096;

/// The topics, services and actions that clients have registered, at most [`MAX_LISTED`] of each. Names are shared
/// with the registry.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Census {
    /// Topics that clients advertise or subscribe to, the runtime's own included, by absolute name.
    pub topics: Vec<ListedTopic>,
    /// Services that clients provide, by absolute name.
    pub services: Vec<ListedService>,
    /// Actions that clients serve, by absolute name.
    pub actions: Vec<ListedService>,
}

impl Census {
    /// The most bytes of a list of it: every byte of a name may be escaped as six.
    #[must_use]
    pub fn most_bytes(&self) -> usize {
        let length = |name: &str, type_name: Option<&str>| {
            64 + 6 * (name.len() + type_name.map_or(0, str::len))
        };
        let topics = self.topics.iter();
        let topics = topics.map(|one| length(&one.name, one.type_name.as_deref()));
        let served = self.services.iter().chain(&self.actions);
        let served = served.map(|one| length(&one.name, one.type_name.as_deref()));
        topics.chain(served).sum()
    }
}

/// A topic that clients use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedTopic {
    /// Its name.
    pub name: Arc<str>,
    /// Its type, from the first client that named one.
    pub type_name: Option<Arc<str>>,
    /// Whether a client advertises it.
    pub published: bool,
    /// Whether a client subscribes to it.
    pub subscribed: bool,
}

/// A service that a client provides, or an action that it serves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedService {
    /// Its name.
    pub name: Arc<str>,
    /// Its type, if its provider has named it.
    pub type_name: Option<Arc<str>>,
}

/// A topic, and the nodes that use it.
pub(super) struct TopicRow<'a> {
    pub(super) name: &'a str,
    /// Empty if it is not known.
    pub(super) type_name: &'a str,
    pub(super) publishers: Vec<Node>,
    pub(super) subscribers: Vec<Node>,
}

/// A service or an action, and its node.
pub(super) struct ServedRow<'a> {
    pub(super) name: Cow<'a, str>,
    pub(super) type_name: Option<&'a str>,
    pub(super) node: Node,
}

/// All topics.
pub(super) fn topics(census: &Census) -> Vec<TopicRow<'_>> {
    let own = Topic::ALL.into_iter().map(|topic| {
        let owner = vec![topic.owner()];
        let (publishers, subscribers) = match (topic, topic.direction()) {
            // Goals publish their setpoints there.
            (Topic::JointTrajectory, _) => (vec![Node::IkAction], owner),
            (_, Direction::Published) => (owner, vec![]),
            (_, Direction::Subscribed) => (vec![], owner),
        };
        TopicRow {
            name: topic.name(),
            type_name: topic.type_name(),
            publishers,
            subscribers,
        }
    });
    let mut rows: Vec<TopicRow<'_>> = own.collect();
    for listed in &census.topics {
        let mut own = rows.iter().take(Topic::ALL.len());
        let own = own.position(|row| *row.name == *listed.name);
        let at = own.unwrap_or(rows.len());
        if own.is_none() {
            rows.push(TopicRow {
                name: &listed.name,
                type_name: listed.type_name.as_deref().unwrap_or_default(),
                publishers: vec![],
                subscribers: vec![],
            });
        }
        if let Some(row) = rows.get_mut(at) {
            row.publishers
                .extend(listed.published.then_some(Node::Gateway));
            row.subscribers
                .extend(listed.subscribed.then_some(Node::Gateway));
        }
    }
    rows
}

/// All services.
pub(super) fn services(census: &Census) -> Vec<ServedRow<'_>> {
    let own = own_services().flat_map(|service| {
        let names = service_names(service).into_iter();
        names.map(move |name| ServedRow {
            name: name.into(),
            type_name: Some(service.type_name()),
            node: service.owner(),
        })
    });
    own.chain(of_clients(&census.services)).collect()
}

/// All actions.
pub(super) fn actions(census: &Census) -> Vec<ServedRow<'_>> {
    let own = Action::ALL.into_iter().map(|action| ServedRow {
        name: action.name().into(),
        type_name: Some(action.type_name()),
        node: action.owner(),
    });
    own.chain(of_clients(&census.actions)).collect()
}

fn of_clients(listed: &[ListedService]) -> impl Iterator<Item = ServedRow<'_>> {
    listed.iter().map(|one| ServedRow {
        name: (&*one.name).into(),
        type_name: one.type_name.as_deref(),
        node: Node::Gateway,
    })
}

/// The row of that name.
pub(super) fn named<'a>(rows: Vec<ServedRow<'a>>, name: &str) -> Option<ServedRow<'a>> {
    let name = names::absolute(name);
    rows.into_iter().find(|row| row.name == name)
}

impl ServedRow<'_> {
    /// Whether it is of that type.
    pub(super) fn is_of(&self, type_name: &str) -> bool {
        self.type_name.is_some_and(|own| match self.node {
            Node::Gateway => names::same_type(own, type_name),
            _ => same_service_type(own, type_name),
        })
    }
}

/// The names of nodes, each once.
pub(super) fn node_names<'a>(nodes: impl IntoIterator<Item = &'a Node>) -> BTreeSet<String> {
    nodes.into_iter().map(|node| node_name(*node)).collect()
}

/// The topics and services of a node. All lists are empty if there is no such node.
pub(super) fn node_details(name: &str, census: &Census) -> Value {
    let name = names::relative(name);
    let node = Node::ALL.into_iter().find(|node| node.name() == name);
    let (topics, services) = (topics(census), services(census));
    let node = node.as_slice();
    let of = |nodes: &[Node]| node.iter().any(|node| nodes.contains(node));
    let publishing = topics.iter().filter(|row| of(&row.publishers));
    let subscribing = topics.iter().filter(|row| of(&row.subscribers));
    let services = services.iter().filter(|row| of(&[row.node]));
    json!({
        "subscribing": subscribing.map(|row| row.name).collect::<BTreeSet<_>>(),
        "publishing": publishing.map(|row| row.name).collect::<BTreeSet<_>>(),
        "services": services.map(|row| &row.name).collect::<Vec<_>>(),
    })
}

/// A node's name in the answers.
pub(super) fn node_name(node: Node) -> String {
    format!("/{}", node.name())
}

/// Every service of the runtime's own, in the order of the documentation.
pub(super) fn own_services() -> impl Iterator<Item = Service> {
    let questions = Rosapi::ALL.into_iter().map(Service::Rosapi);
    Service::ALL.into_iter().chain(questions)
}

/// The names of a service. A service of rosapi has two.
fn service_names(service: Service) -> Vec<String> {
    match service {
        Service::Rosapi(question) => [PREFIX, PRIVATE_PREFIX]
            .map(|prefix| format!("{prefix}{}", question.short_name()))
            .to_vec(),
        other => vec![other.name().to_owned()],
    }
}

/// The same type. Older clients use `rosapi` for `rosapi_msgs`.
pub(super) fn same_service_type(own: &str, name: &str) -> bool {
    let older = own
        .strip_prefix("rosapi_msgs/")
        .map(|rest| format!("rosapi/{rest}"));
    names::same_type(own, name) || older.is_some_and(|older| names::same_type(&older, name))
}
