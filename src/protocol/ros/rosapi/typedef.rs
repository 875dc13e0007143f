//! Types of messages, services and actions, in the format of rosapi.
//!
//! **Invariant:** a type is returned with every type inside it, each once.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::graph::{are_same_type, own_services};
use crate::protocol::catalog::types::{self, Count, Type};
use crate::protocol::catalog::{Action, Field, Rosapi, Service, message};
use crate::protocol::names;

/// The type whose fields the question asks for: a message type, or a part of a service's or an action's type.
#[must_use]
pub fn asked_type(question: Rosapi, name: &str) -> Option<Type> {
    let service = || own_services().find(|one| are_same_type(one.type_name(), name));
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
pub(super) fn details(question: Rosapi, name: &str) -> Option<Value> {
    let mut ending = match question {
        Rosapi::ServiceRequestDetails => "_Request",
        Rosapi::ServiceResponseDetails => "_Response",
        _ => "",
    };
    let all = types::with_parts(asked_type(question, name)?).into_iter();
    // Only the first is a request or a response.
    let all = all.map(|one| typedef(&one, std::mem::take(&mut ending)));
    Some(all.collect())
}

/// Every type that the runtime knows, each once.
pub(super) fn interfaces() -> BTreeSet<&'static str> {
    let messages = types::all().map(|one| one.name);
    let services = own_services().map(Service::type_name);
    let actions = Action::ALL.into_iter().map(Action::type_name);
    messages.chain(services).chain(actions).collect()
}

/// A `rosapi_msgs/msg/TypeDef`. Its name has no middle part. The length of an array is -1 for one value, 0 for any
/// number, or the number of entries.
fn typedef(one: &Type, ending: &str) -> Value {
    let elements: Vec<_> = one.fields.iter().map(Field::element).collect();
    let length = |count| match count {
        Count::One => -1,
        Count::Any => 0,
        Count::Exactly(count) => i32::try_from(count).unwrap_or(i32::MAX),
    };
    let kinds = elements.iter().map(|(kind, _)| names::short_type(kind));
    let lengths = elements.iter().map(|(_, count)| length(*count));
    let examples = elements.iter().map(|(kind, count)| example(kind, *count));
    json!({
        "type": names::short_type(one.name) + ending,
        "fieldnames": one.fields.iter().map(|field| field.name).collect::<Value>(),
        "fieldtypes": kinds.collect::<Value>(),
        "fieldarraylen": lengths.collect::<Value>(),
        "examples": examples.collect::<Value>(),
        "constnames": one.constants().map(|(_, name, _)| name).collect::<Value>(),
        "constvalues": one.constants().map(|(_, _, value)| value).collect::<Value>(),
    })
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
