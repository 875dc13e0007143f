//! Spellings of names: topics and services with and without the leading slash, types with and without their middle part,
//! and ids of the runtime's own requests.
//!
//! **Invariant:** two spellings of a name have the same [`absolute`] name, or the same [`short_type`]. An answer keeps the
//! spelling of the request.

use std::borrow::Cow;

/// The prefix of the runtime's own ids, of forwarded calls and of fragmented messages. It shows their origin in a
/// client's log.
const OWN_ID_PREFIX: &str = "pendularm:";
/// Longest spelling of an own id in JSON: prefix, twenty digits, quotes, each character escaped as `\u0070`.
const LONGEST_ID: usize = 6 * (OWN_ID_PREFIX.len() + 20) + 2;

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

// ---- types ----------------------------------------------------------------------------------------------------------

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

// ---- own ids: each spelling of an id in JSON has its number -----------------------------------------------------------

/// The id of request `number` at its provider, or of the pieces of a message.
#[must_use]
pub fn own_id(number: u64) -> String {
    format!("{OWN_ID_PREFIX}{number}")
}

/// The number of the request that has this id, which is JSON.
#[must_use]
pub fn own_id_number(id: &str) -> Option<u64> {
    let id = Some(id).filter(|id| id.len() <= LONGEST_ID)?;
    let id: String = serde_json::from_str(id).ok()?;
    let number: u64 = id.strip_prefix(OWN_ID_PREFIX)?.parse().ok()?;
    // Each request has one id, though `+1` and `01` are numbers too.
    (id == own_id(number)).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calls_id_is_known_however_its_provider_spells_it() {
        let id = own_id(u64::MAX);
        let escaped: String = id.bytes().map(|byte| format!("\\u{byte:04x}")).collect();
        for spelling in [format!("\"{id}\""), format!("\"{escaped}\"")] {
            assert_eq!(own_id_number(&spelling), Some(u64::MAX));
        }
        let another = format!("\"{OWN_ID_PREFIX}01\"");
        assert_eq!(own_id_number(&another), None);
    }
}
