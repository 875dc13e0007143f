//! The graph of nodes, topics and services, from the catalog and from clients.
//!
//! **Invariant:** the runtime's entries come first, in the order of the documentation. Clients appear as the
//! node `/gateway`.

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

/// All nodes, topics and services.
pub(super) struct Graph<'a> {
    pub(super) census: &'a Census,
}

impl Graph<'_> {
    /// Topics that only clients use.
    fn foreign(&self) -> impl Iterator<Item = &ListedTopic> {
        let topics = self.census.topics.iter();
        topics.filter(|topic| Topic::from_name(&topic.name).is_none())
    }

    /// Clients' use of the topic, if there is any.
    fn listed(&self, name: &str) -> Option<&ListedTopic> {
        let name = names::absolute(name);
        let mut topics = self.census.topics.iter();
        topics.find(|topic| *topic.name == *name)
    }

    pub(super) fn topics(&self) -> (Vec<String>, Vec<String>) {
        let own = Topic::ALL
            .into_iter()
            .map(|topic| (topic.name().to_owned(), topic.type_name().to_owned()));
        let foreign = self.foreign().map(|topic| {
            let type_name = topic.type_name.as_deref().unwrap_or_default();
            (topic.name.to_string(), type_name.to_owned())
        });
        own.chain(foreign).unzip()
    }

    pub(super) fn topics_of(&self, type_name: &str) -> Vec<String> {
        let (topics, types) = self.topics();
        let both = topics.into_iter().zip(types);
        both.filter(|(_, one)| names::same_type(one, type_name))
            .map(|(topic, _)| topic)
            .collect()
    }

    pub(super) fn topic_type(&self, name: &str) -> String {
        match Topic::from_name(name) {
            Some(topic) => topic.type_name().to_owned(),
            None => self
                .listed(name)
                .and_then(|topic| topic.type_name.as_deref())
                .unwrap_or_default()
                .to_owned(),
        }
    }

    pub(super) fn publishers(&self, name: &str) -> BTreeSet<String> {
        let mut nodes: BTreeSet<String> = Topic::from_name(name)
            .into_iter()
            .flat_map(publishing_nodes)
            .map(node_name)
            .collect();
        if self.listed(name).is_some_and(|topic| topic.published) {
            nodes.insert(node_name(Node::Gateway));
        }
        nodes
    }

    pub(super) fn subscribers(&self, name: &str) -> BTreeSet<String> {
        let mut nodes: BTreeSet<String> = Topic::from_name(name)
            .filter(|topic| topic.direction() == Direction::Subscribed)
            .into_iter()
            .map(|topic| node_name(topic.owner()))
            .collect();
        if self.listed(name).is_some_and(|topic| topic.subscribed) {
            nodes.insert(node_name(Node::Gateway));
        }
        nodes
    }

    pub(super) fn services(&self) -> Vec<String> {
        let foreign = self.census.services.iter().map(|one| one.name.to_string());
        own_services()
            .flat_map(service_names)
            .chain(foreign)
            .collect()
    }

    pub(super) fn services_of(&self, type_name: &str) -> Vec<String> {
        let own = own_services_of(type_name).flat_map(service_names);
        let foreign = self.foreign_services_of(type_name);
        own.chain(foreign.map(|one| one.name.to_string())).collect()
    }

    /// Services of that type that clients provide.
    fn foreign_services_of(&self, type_name: &str) -> impl Iterator<Item = &ListedService> {
        let services = self.census.services.iter();
        services.filter(move |service| {
            let own = service.type_name.as_deref();
            own.is_some_and(|own| names::same_type(own, type_name))
        })
    }

    /// A service's type and node; both are empty if there is no such service.
    pub(super) fn service(&self, name: &str) -> (String, String) {
        let own = Service::from_name(name);
        if let Some(service) = own {
            return (service.type_name().to_owned(), node_name(service.owner()));
        }
        let name = names::absolute(name);
        let mut foreign = self.census.services.iter();
        match foreign.find(|service| *service.name == *name) {
            None => Default::default(),
            Some(service) => {
                let type_name = service.type_name.as_deref().unwrap_or_default();
                (type_name.to_owned(), node_name(Node::Gateway))
            }
        }
    }

    pub(super) fn providers(&self, type_name: &str) -> BTreeSet<String> {
        let own = own_services_of(type_name).map(|service| node_name(service.owner()));
        let foreign = self.foreign_services_of(type_name).take(1);
        own.chain(foreign.map(|_| node_name(Node::Gateway)))
            .collect()
    }

    pub(super) fn actions(&self) -> Vec<String> {
        let own = Action::ALL.map(|action| action.name().to_owned());
        let foreign = self.census.actions.iter().map(|one| one.name.to_string());
        own.into_iter().chain(foreign).collect()
    }

    /// An action's type; empty if there is no such action or its type is unknown.
    pub(super) fn action_type(&self, name: &str) -> String {
        if let Some(action) = Action::from_name(name) {
            return action.type_name().to_owned();
        }
        let name = names::absolute(name);
        let mut foreign = self.census.actions.iter();
        let found = foreign.find(|action| *action.name == *name);
        let type_name = found.and_then(|action| action.type_name.as_deref());
        type_name.unwrap_or_default().to_owned()
    }

    /// All lists are empty if there is no such node.
    pub(super) fn node_details(&self, name: &str) -> Value {
        let name = names::relative(name);
        let Some(node) = Node::ALL.into_iter().find(|node| node.name() == name) else {
            return json!({"subscribing": [], "publishing": [], "services": []});
        };
        let own = |chosen: &dyn Fn(Topic) -> bool| -> BTreeSet<String> {
            let chosen = Topic::ALL.into_iter().filter(|topic| chosen(*topic));
            chosen.map(|topic| topic.name().to_owned()).collect()
        };
        let mut publishing = own(&|topic| publishing_nodes(topic).contains(&node));
        let mut subscribing =
            own(&|topic| topic.direction() == Direction::Subscribed && topic.owner() == node);
        let mut services: Vec<String> = own_services()
            .filter(|service| service.owner() == node)
            .flat_map(service_names)
            .collect();
        if node == Node::Gateway {
            for topic in &self.census.topics {
                if topic.published {
                    publishing.insert(topic.name.to_string());
                }
                if topic.subscribed {
                    subscribing.insert(topic.name.to_string());
                }
            }
            services.extend(self.census.services.iter().map(|one| one.name.to_string()));
        }
        json!({"subscribing": subscribing, "publishing": publishing, "services": services})
    }
}

/// The runtime's nodes that publish a topic.
fn publishing_nodes(topic: Topic) -> Vec<Node> {
    match (topic, topic.direction()) {
        // Goals publish their setpoints there.
        (Topic::JointTrajectory, _) => vec![Node::IkAction],
        (_, Direction::Published) => vec![topic.owner()],
        (_, Direction::Subscribed) => vec![],
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

fn own_services_of(type_name: &str) -> impl Iterator<Item = Service> {
    own_services().filter(move |service| same_service_type(service.type_name(), type_name))
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
