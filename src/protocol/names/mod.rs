//! Spellings of names: topics and services with and without the leading slash.
//!
//! **Invariant:** two spellings of a name have the same [`absolute`] name. An answer keeps the spelling of the request.

mod own_ids;
mod types;

use std::borrow::Cow;

pub use self::own_ids::{own_id, own_id_number};
pub use self::types::{same_type, short_type};

/// The name with its leading slash, as in the registry and the catalog.
#[must_use]
pub fn absolute(name: &str) -> Cow<'_, str> {
    if name.starts_with('/') {
        Cow::Borrowed(name)
    } else {
        Cow::Owned(format!("/{name}"))
    }
}

/// Whether two names are spellings of the same topic, service or action.
#[must_use]
pub fn are_same(one: &str, other: &str) -> bool {
    absolute(one) == absolute(other)
}

/// The name without its leading slash, as some clients spell it. It does not change if it would otherwise be another
/// name.
#[must_use]
pub fn relative(name: &str) -> &str {
    name.strip_prefix('/')
        .filter(|rest| !rest.starts_with('/'))
        .unwrap_or(name)
}

/// The action whose goals this service of ROS 2 cancels.
#[must_use]
pub fn cancelled_action(service: &str) -> Option<&str> {
    service.strip_suffix("/_action/cancel_goal")
}

/// Every spelling of an absolute name, the absolute name first.
pub fn spellings(name: &str) -> impl Iterator<Item = &str> {
    let short = Some(relative(name)).filter(|short| *short != name);
    std::iter::once(name).chain(short)
}
