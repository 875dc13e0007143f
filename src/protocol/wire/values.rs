//! Values in JSON input, lenient about numbers.
//!
//! Python's `json` writes `NaN`, `Infinity` and `-Infinity`, and any client may write `1e999`. In the input, these
//! names become literals that overflow (`literals.rs`). So the parser accepts the frame, [`number`] returns a
//! non-finite value, and the field's reader rejects it by name.
//!
//! **Invariant:** one pass, linear in the length of any text.

use std::fmt;

use serde::de::{Deserializer, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::json::members_into;

/// The value of a JSON number, infinite if the literal overflows; `None` if `raw` is not a number.
#[must_use]
pub fn number(raw: &RawValue) -> Option<f64> {
    let token = raw.get();
    match token.as_bytes().first() {
        Some(b'-' | b'0'..=b'9') => token.parse().ok(),
        _ => None,
    }
}

/// The value of a JSON number that is a whole number, 0 or more (`10.0` and `1e1` too; saturating); else `None`.
#[must_use]
pub fn integer(raw: &RawValue) -> Option<u64> {
    if let Ok(integer) = raw.get().parse() {
        return Some(integer);
    }
    let value = number(raw).filter(|value| value.is_finite() && *value >= 0.0)?;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative and without a fraction; saturation is documented"
    )]
    (value.fract() == 0.0).then_some(value as u64)
}

/// The value of a JSON `true` or `false`.
#[must_use]
pub fn boolean(raw: &RawValue) -> Option<bool> {
    match raw.get() {
        "true" => Some(true),
        "false" => Some(false),
        _ => None,
    }
}

/// [`members_into`] for a fixed number of names: returns their values.
pub(crate) fn members<'a, const N: usize>(
    text: &'a str,
    names: &[&str; N],
) -> Result<[Option<&'a RawValue>; N], serde_json::Error> {
    let mut values = [None; N];
    members_into(text, names, &mut values)?;
    Ok(values)
}

/// The entries of a JSON array.
#[derive(Default)]
pub(crate) struct Entries<'a> {
    /// The first entries, at most the requested number.
    pub(crate) first: Vec<&'a RawValue>,
    /// The last entry.
    pub(crate) last: Option<&'a RawValue>,
    /// The number of entries.
    pub(crate) count: usize,
}

/// Reads the array `raw` and keeps at most `limit` entries, so a long array uses little memory. `None` if it is
/// not an array.
pub(crate) fn entries(raw: &RawValue, limit: usize) -> Option<Entries<'_>> {
    let mut entries = Entries::default();
    for_each(raw, |entry| {
        if entries.count < limit {
            entries.first.push(entry);
        }
        entries.count += 1;
        entries.last = Some(entry);
    })?;
    Some(entries)
}

/// Passes each entry of the array `raw` to `take`. `None` if it is not an array.
pub(crate) fn for_each<'a>(raw: &'a RawValue, take: impl FnMut(&'a RawValue)) -> Option<()> {
    raw.deserialize_seq(Each(take)).ok()
}

struct Each<F>(F);

impl<'a, F: FnMut(&'a RawValue)> Visitor<'a> for Each<F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON array")
    }

    fn visit_seq<A: SeqAccess<'a>>(mut self, mut seq: A) -> Result<(), A::Error> {
        while let Some(entry) = seq.next_element()? {
            (self.0)(entry);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A client may send a million entries in place of two.
    #[test]
    fn no_more_entries_are_kept_than_were_asked_for_but_all_are_counted() {
        let raw = RawValue::from_string("[1,2,3,4]".to_owned()).unwrap();
        let entries = entries(&raw, 2).unwrap();
        let first: Vec<&str> = entries.first.iter().map(|entry| entry.get()).collect();
        assert_eq!((first, entries.count), (vec!["1", "2"], 4));
        assert_eq!(entries.last.map(RawValue::get), Some("4"));
    }
}
