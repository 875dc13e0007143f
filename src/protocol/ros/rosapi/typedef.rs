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

/// The type whose fields the question asks for: a message type, or a part of a service's or an action's type.
#[must_use]
pub fn asked_type(question: Rosapi, name: &str) -> Option<Type> {
    let service = || own_services().find(|one| same_service_type(one.type_name(), name));
    let action = || {
        let mut all = Action::ALL.into_iter();
        let action = all.find(|action| names::same_type(action.type_name(), name));
        action.map(Action::parts)
    };
    Some(match question {
        Rosapi::MessageDetails => types::find(name)?,
        Rosapi::ServiceRequestDetails => message(service()?.type_name(), service()?.fields()),
        Rosapi::ServiceResponseDetails => {
            message(service()?.type_name(), service()?.response_fields())
        }
        Rosapi::ActionGoalDetails => action().map(|[goal, _, _]| goal)?,
        Rosapi::ActionResultDetails => action().map(|[_, result, _]| result)?,
        Rosapi::ActionFeedbackDetails => action().map(|[_, _, feedback]| feedback)?,
        _ => return None,
    })
}

/// That type and all types in it, field by field; `None` if it is unknown.
pub(super) fn details(question: Rosapi, name: &str) -> Option<Vec<TypeDef>> {
    let all = types::with_parts(asked_type(question, name)?).into_iter();
    let mut all: Vec<TypeDef> = all
        .map(|one| TypeDef::new(names::short_type(one.name), &one))
        .collect();
    if let Some(first) = all.first_mut() {
        first.name += match question {
            Rosapi::ServiceRequestDetails => "_Request",
            Rosapi::ServiceResponseDetails => "_Response",
            _ => "",
        };
    }
    Some(all)
}

/// Every type that the runtime knows, each once.
pub(super) fn interfaces() -> BTreeSet<&'static str> {
    let messages = types::all().map(|one| one.name);
    let services = own_services().map(Service::type_name);
    let actions = Action::ALL.into_iter().map(Action::type_name);
    messages.chain(services).chain(actions).collect()
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
