//! The types of the graph, from the catalog. Messages are unchanged. Services and actions of ROS 2 are built from
//! their parts.
//!
//! ROS 2 has no answer to a refused call. So this project's own services also return `success` and `message`, after the
//! fields of the catalog.
//!
//! **Invariant:** bytes that are written by a type here have that type's hash.

use pendularm::protocol::catalog::types::Type;
use pendularm::protocol::catalog::{Action, Field, Service};

use crate::convention::hash::type_hash;

/// The package of this project's own types.
const OURS: &str = "pendularm_interfaces/";
/// The field that ROS 2 adds to a type without fields, because DDS has no empty types.
pub const NOTHING: [Field; 1] = [field("structure_needs_at_least_one_member", "uint8")];
/// The fields with the outcome of a call.
const OUTCOME: [Field; 2] = [field("success", "bool"), field("message", "string")];

/// A service's type.
#[derive(Debug, Clone)]
pub struct ServiceInterface {
    /// Its name: `pendularm_interfaces/srv/Pause`.
    pub name: &'static str,
    /// A request.
    pub request: Type,
    /// A response.
    pub response: Type,
    /// Its hash.
    pub hash: String,
}

const fn field(name: &'static str, kind: &'static str) -> Field {
    Field {
        name,
        kind,
        unit: "",
        required: true,
    }
}

impl ServiceInterface {
    /// The type of one of the arm's services.
    #[must_use]
    pub fn of_catalogue(service: Service) -> Self {
        let mut response = service.response_fields().to_vec();
        if service.type_name().starts_with(OURS) {
            response.extend(OUTCOME);
        }
        Self::new(service.type_name(), service.fields(), &response)
    }

    /// A type with these fields in a request and in a response.
    #[must_use]
    pub fn new(name: &'static str, request: &[Field], response: &[Field]) -> Self {
        Self::with(name, request, response, &[])
    }

    /// The same with inner types that differ from the catalog.
    fn with(name: &'static str, request: &[Field], response: &[Field], inside: &[Type]) -> Self {
        let request = structure(format!("{name}_Request"), request);
        let response = structure(format!("{name}_Response"), response);
        let up_to_one = |one: Type| kept(format!("{}[<=1]", one.name));
        let event = structure(
            format!("{name}_Event"),
            &[
                field("info", "service_msgs/msg/ServiceEventInfo"),
                field("request", up_to_one(request)),
                field("response", up_to_one(response)),
            ],
        );
        let whole = structure(
            name.to_owned(),
            &[
                field("request_message", request.name),
                field("response_message", response.name),
                field("event_message", event.name),
            ],
        );
        let beside = [&[request, response, event], inside].concat();
        let hash = type_hash(whole, &beside);
        Self {
            name,
            request,
            response,
            hash,
        }
    }

    /// Whether a response has the outcome of the call.
    #[must_use]
    pub fn tells_outcome(&self) -> bool {
        self.response.fields.ends_with(&OUTCOME)
    }
}

/// An action's type: two services and a message, besides those of all actions.
#[derive(Debug, Clone)]
pub struct ActionInterface {
    /// Sends a goal.
    pub send_goal: ServiceInterface,
    /// Waits for a goal's end.
    pub get_result: ServiceInterface,
    /// Feedback, with the id of its goal.
    pub feedback: Type,
    /// Its hash.
    pub feedback_hash: String,
}

impl ActionInterface {
    /// The type of one of the arm's actions.
    #[must_use]
    pub fn of_catalogue(action: Action) -> Self {
        let name = action.type_name();
        let [goal, result, feedback] = action
            .parts()
            .map(|part| structure(part.name.to_owned(), part.fields));
        let beside = [goal, result, feedback];
        let goal_id = field("goal_id", "unique_identifier_msgs/msg/UUID");
        let send_goal = ServiceInterface::with(
            kept(format!("{name}_SendGoal")),
            &[goal_id, field("goal", goal.name)],
            &[
                field("accepted", "bool"),
                field("stamp", "builtin_interfaces/msg/Time"),
            ],
            &beside,
        );
        let get_result = ServiceInterface::with(
            kept(format!("{name}_GetResult")),
            &[goal_id],
            &[field("status", "int8"), field("result", result.name)],
            &beside,
        );
        let message = structure(
            format!("{name}_FeedbackMessage"),
            &[goal_id, field("feedback", feedback.name)],
        );
        Self {
            send_goal,
            get_result,
            feedback: message,
            feedback_hash: type_hash(message, &beside),
        }
    }
}

/// The cancel service of every action.
#[must_use]
pub fn cancel_goal() -> ServiceInterface {
    ServiceInterface::new(
        "action_msgs/srv/CancelGoal",
        &[field("goal_info", "action_msgs/msg/GoalInfo")],
        &[
            field("return_code", "int8"),
            field("goals_canceling", "action_msgs/msg/GoalInfo[]"),
        ],
    )
}

/// A type with that name in the form of ROS 2: with at least one field, and with arrays of arrays as one array, row
/// after row.
fn structure(name: String, fields: &[Field]) -> Type {
    let flat = |field: &Field| match field.kind.strip_suffix("[][]") {
        Some(kind) => Field {
            kind: kept(format!("{kind}[]")),
            ..*field
        },
        None => *field,
    };
    let fields = if fields.is_empty() { &NOTHING } else { fields };
    Type {
        name: kept(name),
        fields: Box::leak(fields.iter().map(flat).collect()),
        constants: "",
    }
}

/// A text with a static lifetime. Types are created once at the start, and needed until the end.
fn kept(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

#[cfg(test)]
mod tests {
    use pendularm::protocol::catalog::Rosapi;

    use super::*;

    /// From the code that ROS 2 generates for them.
    #[test]
    fn services_of_ros_2_have_its_hashes() {
        let one = ServiceInterface::of_catalogue(Service::DescribeParameters);
        assert_eq!(
            one.hash,
            "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff"
        );
        assert_eq!(
            cancel_goal().hash,
            "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"
        );
    }

    #[test]
    fn only_our_own_services_have_success_and_message() {
        let ours = ServiceInterface::of_catalogue(Service::TrialStop);
        assert!(ours.tells_outcome());
        assert_eq!(ours.request.fields, NOTHING);
        let theirs = ServiceInterface::of_catalogue(Service::Rosapi(Rosapi::Topics));
        assert!(!theirs.tells_outcome());
        let empty = ServiceInterface::new("std_srvs/srv/Empty", &[], &[]);
        assert_eq!(empty.response.fields, NOTHING);
    }

    #[test]
    fn rows_stand_one_behind_the_other() {
        let one = ServiceInterface::of_catalogue(Service::Rollout);
        let mut fields = one.response.fields.iter();
        let positions = fields.find(|field| field.name == "positions");
        assert_eq!(positions.unwrap().kind, "float64[]");
    }
}
