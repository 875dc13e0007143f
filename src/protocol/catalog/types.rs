//! All message types by name, and their definitions as text.
//!
//! **Invariant:** the type of every field of a known type is known too, so every definition is complete.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::Action;
use super::entry::Field;
pub use super::entry::{Count, Type};
use super::parts;
use super::topics::Topic;
use crate::protocol::names;

/// The separator between the definitions of a type and of the types in it: a line of 80.
const SEPARATOR: &str = "=";

/// All message types: first those of the topics, then the types inside them.
pub fn all() -> impl Iterator<Item = Type> {
    let topics = Topic::ALL.into_iter().map(Topic::message);
    topics.chain(parts::TYPES.iter().copied())
}

/// The types by name, and by name without the middle part. One query about types looks up hundreds.
static BY_NAME: LazyLock<HashMap<String, Type>> = LazyLock::new(|| {
    let parts = || Action::ALL.into_iter().flat_map(Action::parts);
    let mut by_name = HashMap::new();
    for one in all().chain(parts()) {
        by_name.entry(one.name.to_owned()).or_insert(one);
    }
    for one in all().chain(parts()) {
        by_name.entry(names::short_type(one.name)).or_insert(one);
    }
    by_name
});

/// The type of that name, including the types of an action's goal, result and feedback. The middle part of the name
/// is optional.
#[must_use]
pub fn find(name: &str) -> Option<Type> {
    let found = BY_NAME.get(name);
    let found = found.or_else(|| BY_NAME.get(&names::short_type(name)));
    found
        .copied()
        .filter(|one| names::same_type(one.name, name))
}

/// The members of an object field of a request, a message or a response, in documented order; empty for every other
/// field.
#[must_use]
pub fn members(field: &Field) -> &'static [Field] {
    find(field.kind).map_or(&[], |one| one.fields)
}

/// `first` and every type inside it, each once, in the order of first use.
#[must_use]
pub fn with_parts(first: Type) -> Vec<Type> {
    let mut found = vec![first];
    let mut at = 0;
    while let Some(one) = found.get(at).copied() {
        for field in one.fields {
            let (kind, _) = field.element();
            if let Some(part) = find(kind)
                && !found.iter().any(|known| known.name == part.name)
            {
                found.push(part);
            }
        }
        at += 1;
    }
    found
}

/// The text that defines a type and all types in it, in the format of `.msg` files, with units in comments.
#[must_use]
pub fn full_text(name: &str) -> Option<String> {
    find(name).map(definition)
}

/// The same for a type that may be outside the catalog.
#[must_use]
pub fn definition(first: Type) -> String {
    let mut text = String::new();
    for (index, one) in with_parts(first).into_iter().enumerate() {
        if index > 0 {
            text.push_str(&SEPARATOR.repeat(80));
            text.push_str("\nMSG: ");
            text.push_str(&names::short_type(one.name));
            text.push('\n');
        }
        text.push_str(&own_text(one));
    }
    text
}

/// The definition of one type: constants, then fields with their units.
#[must_use]
pub fn own_text(one: Type) -> String {
    let constants = one.constants();
    let constants = constants.map(|(kind, name, value)| format!("{kind} {name}={value}\n"));
    let fields = one.fields.iter().map(|field| {
        let kind = names::short_type(field.kind);
        match field.unit {
            "" => format!("{kind} {}\n", field.name),
            unit => format!("{kind} {}  # {unit}\n", field.name),
        }
    });
    constants.chain(fields).collect()
}
