//! Spellings of types: with and without their middle part.
//!
//! **Invariant:** two spellings of a type have the same [`short_type`].

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
