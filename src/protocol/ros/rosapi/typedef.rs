//! Types of messages, services and actions, in the format of rosapi.
//!
//! **Invariant:** a type is returned with every type inside it, each once.

use std::collections::BTreeSet;

use serde::Serialize;

use super::graph::{own_services, same_service_type};
use crate::protocol::catalog::types::{self, Count, Type};
use crate::protocol::catalog::{Action, Field, Rosapi, Service, message};
use crate::protocol::names;

/// A type in the format of rosapi, field by field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TypeDef {
    /// Its name, without the middle part.
    #[serde(rename = "type")]
    pub name: String,
    /// Names of the fields.
    pub fieldnames: Vec<&'static str>,
    /// Their types, without brackets.
    pub fieldtypes: Vec<String>,
    /// -1 for one value, 0 for any number, or the number of entries.
    pub fieldarraylen: Vec<i32>,
    /// An example value of each.
    pub examples: Vec<&'static str>,
    /// Names of the constants.
    pub constnames: Vec<&'static str>,
    /// Their values.
    pub constvalues: Vec<&'static str>,
}

/// The type of that name, field by field; `None` if it is unknown.
pub(super) fn details(question: Rosapi, name: &str) -> Option<Vec<TypeDef>> {
    let service = || own_services().find(|one| same_service_type(one.type_name(), name));
    let action = || {
        let mut all = Action::ALL.into_iter();
        let action = all.find(|action| names::same_type(action.type_name(), name));
        action.map(Action::parts)
    };
    Some(match question {
        Rosapi::MessageDetails => typedefs(types::find(name)?),
        Rosapi::ServiceRequestDetails => part_typedefs(service()?, "Request", service()?.fields()),
        Rosapi::ServiceResponseDetails => {
            part_typedefs(service()?, "Response", service()?.response_fields())
        }
        Rosapi::ActionGoalDetails => action().map(|[goal, _, _]| typedefs(goal))?,
        Rosapi::ActionResultDetails => action().map(|[_, result, _]| typedefs(result))?,
        Rosapi::ActionFeedbackDetails => action().map(|[_, _, feedback]| typedefs(feedback))?,
        _ => return None,
    })
}

/// Every type that the runtime knows, each once.
pub(super) fn interfaces() -> BTreeSet<&'static str> {
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

/// One part of a service's type, and all types in it.
fn part_typedefs(service: Service, part: &str, fields: &'static [Field]) -> Vec<TypeDef> {
    let mut all = typedefs(message(service.type_name(), fields));
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
                .map(|(_, count)| match count {
                    Count::One => -1,
                    Count::Any => 0,
                    Count::Exactly(count) => i32::try_from(count).unwrap_or(i32::MAX),
                })
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
        (Count::Any | Count::Exactly(_), _) => "[]",
        (_, "string") => "",
        (_, "bool") => "false",
        (_, "float64" | "float32") => "0.0",
        (_, kind) if kind.contains('/') => "{}",
        _ => "0",
    }
}
