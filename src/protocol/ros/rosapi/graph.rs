//! The graph of nodes, topics and services, from the catalog and from clients.
//!
//! **Invariant:** the runtime's entries come first, in the order of the documentation. Clients appear as the
//! node `/gateway`.

use std::borrow::Cow;
use std::sync::Arc;

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
    pub topics: Vec<Listed>,
    /// Services that clients provide, by absolute name.
    pub services: Vec<Listed>,
    /// Actions that clients serve, by absolute name.
    pub actions: Vec<Listed>,
}

impl Census {
    /// The most bytes of a list of it: every byte of a name may be escaped as six.
    #[must_use]
    pub fn most_bytes(&self) -> usize {
        let all = self.topics.iter().chain(&self.services);
        let all = all.chain(&self.actions);
        let names = all.map(|one| one.name.len() + one.type_name.as_deref().map_or(0, str::len));
        names.map(|bytes| 64 + 6 * bytes).sum()
    }
}

/// A topic, a service or an action of clients.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Its name.
    pub name: Arc<str>,
    /// Its type, from the first client that named one.
    pub type_name: Option<Arc<str>>,
    /// Whether a client publishes the topic, or serves the service or action.
    pub published: bool,
    /// Whether a client subscribes to the topic.
    pub subscribed: bool,
}

/// A topic, a service or an action, and its nodes.
pub(super) struct Row<'a> {
    pub(super) name: Cow<'a, str>,
    /// Empty if it is not known.
    pub(super) type_name: &'a str,
    /// The nodes that publish the topic, or serve the service or action.
    pub(super) publishers: Vec<Node>,
    /// The nodes that subscribe to the topic.
    pub(super) subscribers: Vec<Node>,
}

/// All topics.
pub(super) fn topics(census: &Census) -> Vec<Row<'_>> {
    let own = Topic::ALL.into_iter().map(|topic| {
        let owner = vec![topic.owner()];
        let (publishers, subscribers) = match (topic, topic.direction()) {
            // Goals publish their setpoints there.
            (Topic::JointTrajectory, _) => (vec![Node::IkAction], owner),
            (_, Direction::Published) => (owner, vec![]),
            (_, Direction::Subscribed) => (vec![], owner),
        };
        Row {
            name: topic.name().into(),
            type_name: topic.type_name(),
            publishers,
            subscribers,
        }
    });
    let mut rows: Vec<Row<'_>> = own.collect();
    for listed in &census.topics {
        let publishers = listed.published.then_some(Node::Gateway).into_iter();
        let subscribers = listed.subscribed.then_some(Node::Gateway).into_iter();
        let mut own = rows.iter_mut().take(Topic::ALL.len());
        if let Some(row) = own.find(|row| *row.name == *listed.name) {
            row.publishers.extend(publishers);
            row.subscribers.extend(subscribers);
        } else {
            rows.push(Row {
                name: (&*listed.name).into(),
                type_name: listed.type_name.as_deref().unwrap_or_default(),
                publishers: publishers.collect(),
                subscribers: subscribers.collect(),
            });
        }
    }
    rows
}

/// All services.
pub(super) fn services(census: &Census) -> Vec<Row<'_>> {
    let own = own_services().flat_map(|service| {
        let names = service_names(service).into_iter();
        names.map(move |name| served(name, service.type_name(), service.owner()))
    });
    own.chain(of_clients(&census.services)).collect()
}

/// All actions.
pub(super) fn actions(census: &Census) -> Vec<Row<'_>> {
    let own = Action::ALL.into_iter();
    let own = own.map(|action| served(action.name(), action.type_name(), action.owner()));
    own.chain(of_clients(&census.actions)).collect()
}

fn of_clients(listed: &[Listed]) -> impl Iterator<Item = Row<'_>> {
    listed.iter().map(|one| {
        let type_name = one.type_name.as_deref().unwrap_or_default();
        served(&*one.name, type_name, Node::Gateway)
    })
}

fn served<'a>(name: impl Into<Cow<'a, str>>, type_name: &'a str, node: Node) -> Row<'a> {
    Row {
        name: name.into(),
        type_name,
        publishers: vec![node],
        subscribers: vec![],
    }
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

/// Whether the names are those of one type. Older clients use `rosapi` for `rosapi_msgs`.
pub(super) fn are_same_type(own: &str, name: &str) -> bool {
    let older = own
        .strip_prefix("rosapi_msgs/")
        .map(|rest| format!("rosapi/{rest}"));
    names::same_type(own, name) || older.is_some_and(|older| names::same_type(&older, name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::ros::rosapi::answer;

    #[test]
    fn a_list_of_names_that_must_be_escaped_has_at_most_the_expected_bytes() {
        let empty = Census::default();
        let listed = Listed {
            name: "\u{1}".repeat(200).into(),
            type_name: Some("\u{2}".repeat(100).into()),
            published: true,
            subscribed: false,
        };
        let full = Census {
            topics: vec![listed],
            ..Census::default()
        };
        let bytes = |census| {
            answer(Rosapi::Topics, "", census)
                .unwrap()
                .to_string()
                .len()
        };
        let more = bytes(&full) - bytes(&empty);
        assert!((1800..=full.most_bytes()).contains(&more), "{more}");
    }
}
