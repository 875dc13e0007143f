//! Answers to the questions of rosapi, from the catalog and from what clients have registered.
//!
//! Clients appear as the node `/gateway`, as they do behind any rosbridge. What has to be asked of the arm (parameters,
//! time) is answered elsewhere.
//!
//! **Invariant:** what an answer lists is served: the lists are made from the catalog and the registry's own, for every answer.

use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::{Value, json};

use super::catalog::rosapi::{PREFIX, PRIVATE_PREFIX};
use super::catalog::types::{self, Count, Type};
use super::catalog::{Action, Direction, Field, Node, Rosapi, Service, Topic};
use super::fields::Fields;
use super::names;
use super::op::Arguments;

/// Topics, and services, of clients in one answer: more than any screen shows. The first by name are listed.
pub const MAX_LISTED: usize = 4096;
/// The ROS that all this looks like.
const ROS_VERSION: u8 = 2;
/// The distribution that is told: there is no ROS behind this, and no client should look for its peculiarities.
const DISTRO: &str = "pendularm";

/// What clients have registered; at most [`MAX_LISTED`] of each.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Census {
    /// Topics that clients advertise or subscribe to, the runtime's own included, by absolute name.
    pub topics: Vec<ListedTopic>,
    /// Services that clients provide, by absolute name.
    pub services: Vec<ListedService>,
}

/// A topic that clients use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedTopic {
    /// Its name.
    pub name: Box<str>,
    /// Its type, as the first client to name one had it.
    pub type_name: Option<Box<str>>,
    /// Whether a client advertises it.
    pub published: bool,
    /// Whether a client subscribes to it.
    pub subscribed: bool,
}

/// A service that a client provides.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListedService {
    /// Its name.
    pub name: Box<str>,
    /// Its type, if its provider has named it.
    pub type_name: Option<Box<str>>,
}

/// A type as rosapi lays it out, field by field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TypeDef {
    /// Its name, without the middle part.
    #[serde(rename = "type")]
    pub name: String,
    /// Names of the fields.
    pub fieldnames: Vec<&'static str>,
    /// Their types, without brackets.
    pub fieldtypes: Vec<String>,
    /// -1 for one value, 0 for any number.
    pub fieldarraylen: Vec<i32>,
    /// A value that each may have.
    pub examples: Vec<&'static str>,
    /// Names of the constants.
    pub constnames: Vec<&'static str>,
    /// Their values.
    pub constvalues: Vec<&'static str>,
}

/// The `values` that answer a question.
///
/// # Errors
/// What is wrong with the arguments, or that a type is not known, as a sentence that begins with the field.
pub fn answer(question: Rosapi, args: &Arguments, census: &Census) -> Result<Value, String> {
    let service = Service::Rosapi(question);
    let mut fields = Fields::read(args, service).map_err(|why| why.to_string())?;
    // The catalog has at most one required field for each of these questions.
    let (field, asked) = match service.fields().first() {
        Some(field) => (field.name, fields.text(field.name)),
        None => ("", Some("".into())),
    };
    let asked = asked.ok_or_else(|| fields.status())?;
    let graph = Graph { census };
    let unknown = || format!("{field} must name a type that this runtime knows");
    Ok(match question {
        Rosapi::Topics => {
            let (topics, types) = graph.topics();
            json!({"topics": topics, "types": types})
        }
        Rosapi::TopicsForType => json!({"topics": graph.topics_of(&asked)}),
        Rosapi::TopicsAndRawTypes => {
            let (topics, types) = graph.topics();
            let text = |name: &String| types::full_text(name).unwrap_or_default();
            let texts: Vec<String> = types.iter().map(text).collect();
            json!({"topics": topics, "types": types, "typedefs_full_text": texts})
        }
        Rosapi::TopicType => json!({"type": graph.topic_type(&asked)}),
        Rosapi::Publishers => json!({"publishers": graph.publishers(&asked)}),
        Rosapi::Subscribers => json!({"subscribers": graph.subscribers(&asked)}),
        Rosapi::Services => json!({"services": graph.services()}),
        Rosapi::ServicesForType => json!({"services": graph.services_of(&asked)}),
        Rosapi::ServiceType => json!({"type": graph.service(&asked).0}),
        Rosapi::ServiceNode => json!({"node": graph.service(&asked).1}),
        Rosapi::ServiceProviders => json!({"providers": graph.providers(&asked)}),
        Rosapi::Nodes => json!({"nodes": Node::ALL.map(node_name)}),
        Rosapi::NodeDetails => graph.node_details(&asked),
        Rosapi::MessageDetails
        | Rosapi::ServiceRequestDetails
        | Rosapi::ServiceResponseDetails
        | Rosapi::ActionGoalDetails
        | Rosapi::ActionResultDetails
        | Rosapi::ActionFeedbackDetails => {
            json!({"typedefs": details(question, &asked).ok_or_else(unknown)?})
        }
        Rosapi::ActionServers => json!({"action_servers": Action::ALL.map(Action::name)}),
        Rosapi::ActionType => {
            json!({"type": Action::from_name(&asked).map_or("", Action::type_name)})
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
            return Err("the arm was not asked".to_owned());
        }
    })
}

/// A type of that name, field by field; `None` if the runtime knows none.
fn details(question: Rosapi, name: &str) -> Option<Vec<TypeDef>> {
    let service = || service_of_type(name);
    let action = || {
        let mut all = Action::ALL.into_iter();
        all.find(|action| names::same_type(action.type_name(), name))
    };
    Some(match question {
        Rosapi::MessageDetails => typedefs(types::find(name)?),
        Rosapi::ServiceRequestDetails => {
            part_typedefs(service()?.type_name(), "Request", service()?.fields())
        }
        Rosapi::ServiceResponseDetails => part_typedefs(
            service()?.type_name(),
            "Response",
            service()?.response_fields(),
        ),
        Rosapi::ActionGoalDetails => {
            part_typedefs(action()?.type_name(), "Goal", action()?.goal_fields())
        }
        Rosapi::ActionResultDetails => {
            part_typedefs(action()?.type_name(), "Result", action()?.result_fields())
        }
        Rosapi::ActionFeedbackDetails => part_typedefs(
            action()?.type_name(),
            "Feedback",
            action()?.feedback_fields(),
        ),
        _ => return None,
    })
}

/// A node's name, as the answers have it.
fn node_name(node: Node) -> String {
    format!("/{}", node.name())
}

/// Every service of the runtime's own, in the order of the documentation.
fn own_services() -> impl Iterator<Item = Service> {
    let questions = Rosapi::ALL.into_iter().map(Service::Rosapi);
    Service::ALL.into_iter().chain(questions)
}

/// The names of a service: a question of rosapi has two.
fn service_names(service: Service) -> Vec<String> {
    match service {
        Service::Rosapi(question) => [PREFIX, PRIVATE_PREFIX]
            .map(|prefix| format!("{prefix}{}", question.short_name()))
            .to_vec(),
        other => vec![other.name().to_owned()],
    }
}

fn service_of_type(name: &str) -> Option<Service> {
    own_services().find(|service| same_service_type(service.type_name(), name))
}

/// The same type; older clients say `rosapi` for `rosapi_msgs`.
fn same_service_type(own: &str, name: &str) -> bool {
    let older = own
        .strip_prefix("rosapi_msgs/")
        .map(|rest| format!("rosapi/{rest}"));
    names::same_type(own, name) || older.is_some_and(|older| names::same_type(&older, name))
}

/// Who is there and does what.
struct Graph<'a> {
    census: &'a Census,
}

impl Graph<'_> {
    /// Topics of clients alone.
    fn foreign(&self) -> impl Iterator<Item = &ListedTopic> {
        let topics = self.census.topics.iter();
        topics.filter(|topic| Topic::from_name(&topic.name).is_none())
    }

    /// What clients do with a topic, if anything.
    fn listed(&self, name: &str) -> Option<&ListedTopic> {
        let name = names::absolute(name);
        self.census.topics.iter().find(|topic| *topic.name == *name)
    }

    fn topics(&self) -> (Vec<String>, Vec<String>) {
        let own = Topic::ALL
            .into_iter()
            .map(|topic| (topic.name().to_owned(), topic.type_name().to_owned()));
        let foreign = self.foreign().map(|topic| {
            let type_name = topic.type_name.as_deref().unwrap_or_default();
            (topic.name.to_string(), type_name.to_owned())
        });
        own.chain(foreign).unzip()
    }

    fn topics_of(&self, type_name: &str) -> Vec<String> {
        let (topics, types) = self.topics();
        let both = topics.into_iter().zip(types);
        both.filter(|(_, one)| names::same_type(one, type_name))
            .map(|(topic, _)| topic)
            .collect()
    }

    fn topic_type(&self, name: &str) -> String {
        match Topic::from_name(name) {
            Some(topic) => topic.type_name().to_owned(),
            None => self
                .listed(name)
                .and_then(|topic| topic.type_name.as_deref())
                .unwrap_or_default()
                .to_owned(),
        }
    }

    fn publishers(&self, name: &str) -> BTreeSet<String> {
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

    fn subscribers(&self, name: &str) -> BTreeSet<String> {
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

    fn services(&self) -> Vec<String> {
        let foreign = self.census.services.iter().map(|one| one.name.to_string());
        own_services()
            .flat_map(service_names)
            .chain(foreign)
            .collect()
    }

    fn services_of(&self, type_name: &str) -> Vec<String> {
        let own = own_services()
            .filter(|service| same_service_type(service.type_name(), type_name))
            .flat_map(service_names);
        let foreign = self.census.services.iter().filter(|service| {
            let own = service.type_name.as_deref();
            own.is_some_and(|own| names::same_type(own, type_name))
        });
        own.chain(foreign.map(|one| one.name.to_string())).collect()
    }

    /// A service's type and node; both empty where there is no such service.
    fn service(&self, name: &str) -> (String, String) {
        if let Some(service) = Service::from_name(name) {
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

    fn providers(&self, type_name: &str) -> BTreeSet<String> {
        let services = self.services_of(type_name).into_iter();
        services.map(|service| self.service(&service).1).collect()
    }

    /// All lists are empty where there is no such node.
    fn node_details(&self, name: &str) -> Value {
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
        // Goals send their setpoints there.
        (Topic::JointTrajectory, _) => vec![Node::IkAction],
        (_, Direction::Published) => vec![topic.owner()],
        (_, Direction::Subscribed) => vec![],
    }
}

/// Every type that the runtime knows, each once.
fn interfaces() -> BTreeSet<&'static str> {
    let messages = types::all().map(|one| one.name);
    let services = own_services().map(Service::type_name);
    let actions = Action::ALL.into_iter().map(Action::type_name);
    messages.chain(services).chain(actions).collect()
}

/// A type and all types in it.
fn typedefs(first: Type) -> Vec<TypeDef> {
    let all = types::with_parts(first).into_iter();
    all.map(|one| TypeDef::new(names::short_type(one.name), &one))
        .collect()
}

/// One part of a service's or an action's type, and all types in it.
fn part_typedefs(type_name: &'static str, part: &str, fields: &'static [Field]) -> Vec<TypeDef> {
    let first = Type {
        name: type_name,
        fields,
        constants: &[],
    };
    let mut all = typedefs(first);
    if let Some(first) = all.first_mut() {
        first.name = format!("{}_{part}", first.name);
    }
    all
}

impl TypeDef {
    fn new(name: String, one: &Type) -> Self {
        let fields = one.fields;
        let elements = || fields.iter().map(Field::element);
        Self {
            name,
            fieldnames: fields.iter().map(|field| field.name).collect(),
            fieldtypes: elements()
                .map(|(kind, _)| names::short_type(kind))
                .collect(),
            fieldarraylen: elements()
                .map(|(_, count)| if count == Count::One { -1 } else { 0 })
                .collect(),
            examples: elements()
                .map(|(kind, count)| example(kind, count))
                .collect(),
            constnames: one.constants.iter().map(|one| one.name).collect(),
            constvalues: one.constants.iter().map(|one| one.value).collect(),
        }
    }
}

/// A value of that type, as JSON text.
fn example(kind: &str, count: Count) -> &'static str {
    match (count, kind) {
        (Count::Any, _) => "[]",
        (_, "string") => "",
        (_, "bool") => "false",
        (_, "float64" | "float32") => "0.0",
        (_, kind) if kind.contains('/') => "{}",
        _ => "0",
    }
}
