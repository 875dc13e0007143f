//! Spellings of names: topics and services with and without the leading slash, types with and without their middle
//! part.
//!
//! **Invariant:** two spellings of a name have the same [`absolute`] name or the same [`short_type`]. An answer keeps
//! the spelling of the request.

mod own_ids;

use std::borrow::Cow;

pub use self::own_ids::{own_id, own_id_number};

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

/// A type without its middle part: `std_msgs/Header` of `std_msgs/msg/Header` and of itself.
#[must_use]
pub fn short_type(name: &str) -> String {
    match (name.split_once('/'), name.rsplit_once('/')) {
        (Some((package, _)), Some((_, last))) => format!("{package}/{last}"),
        _ => name.to_owned(),
    }
}

/// Whether two names are spellings of the same type. A middle part that only one of them has is ignored.
///
/// One name is compared with every known type, so only as many bytes are read as the shorter name has.
#[must_use]
pub fn same_type(one: &str, other: &str) -> bool {
    let is_longer = one.len() > other.len();
    let (short, long) = if is_longer {
        (other, one)
    } else {
        (one, other)
    };
    short == long || is_without_middle(short, long)
}

/// Whether `short` is `long`, another name, without its middle part or parts.
fn is_without_middle(short: &str, long: &str) -> bool {
    let parts = short.split_once('/');
    let middle = parts
        .filter(|(_, last)| !last.contains('/'))
        .and_then(|(package, last)| long.strip_prefix(package)?.strip_suffix(last));
    middle.is_some_and(|middle| middle.starts_with('/') && middle.ends_with('/'))
}
