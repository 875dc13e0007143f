//! The members of a JSON object and the entries of an array, as they stand in the text.
//!
//! **Invariant:** the text is read in one pass, and memory is taken only for what is asked for.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;

/// Reads the JSON object `text` and gives, for each of `names`, the raw value under that key: the last one where a key
/// is repeated. Other members are checked for syntax and ignored.
///
/// # Errors
/// Where `text` is not one valid JSON object. The reason does not repeat a string in its place: to escape that would
/// take fifty times as long as to read it.
pub(crate) fn members<'a, const N: usize>(
    text: &'a str,
    names: &[&str; N],
) -> Result<[Option<&'a RawValue>; N], serde_json::Error> {
    let mut values = [None; N];
    members_into(text, names, &mut values)?;
    Ok(values)
}

/// [`members`] for a list of names whose length is known at run time; `values` is as long as `names`.
pub(crate) fn members_into<'a>(
    text: &'a str,
    names: &[&str],
    values: &mut [Option<&'a RawValue>],
) -> Result<(), serde_json::Error> {
    if text.trim_ascii_start().starts_with('"') {
        return Err(serde::de::Error::custom("a string, not an object"));
    }
    let mut deserializer = serde_json::Deserializer::from_str(text);
    Members { names, values }.deserialize(&mut deserializer)?;
    deserializer.end()
}

/// A JSON array, read no further than it has to be.
pub(crate) struct Entries<'a> {
    /// The first entries, at most as many as were asked for.
    pub(crate) first: Vec<&'a RawValue>,
    /// The last entry.
    pub(crate) last: Option<&'a RawValue>,
    /// How many entries there are.
    pub(crate) count: usize,
}

/// Reads the array `raw`, keeping at most `limit` entries: a long array costs time, not memory. `None` if it is no
/// array.
pub(crate) fn entries(raw: &RawValue, limit: usize) -> Option<Entries<'_>> {
    let inside = raw.get().strip_prefix('[')?.strip_suffix(']')?;
    let mut entries = Entries {
        first: Vec::new(),
        last: None,
        count: 0,
    };
    if inside.trim_ascii().is_empty() {
        return Some(entries);
    }
    let mut start = 0;
    loop {
        let end = entry_end(inside.as_bytes(), start);
        let is_last = end == inside.len();
        entries.count += 1;
        if is_last || entries.count <= limit {
            let entry = serde_json::from_str(inside.get(start..end)?).ok()?;
            if entries.count <= limit {
                entries.first.push(entry);
            }
            if is_last {
                entries.last = Some(entry);
                return Some(entries);
            }
        }
        start = end + 1;
    }
}

/// The index of the comma behind the entry that begins at `start`, or of the end: in a valid array without its brackets
/// whatever is open closes.
fn entry_end(inside: &[u8], start: usize) -> usize {
    let mut at = start;
    let mut open = 0_usize;
    while let Some(byte) = inside.get(at) {
        match byte {
            b'"' => {
                at = string_end(inside, at);
                continue;
            }
            b'[' | b'{' => open += 1,
            b']' | b'}' => open = open.saturating_sub(1),
            b',' if open == 0 => return at,
            _ => (),
        }
        at += 1;
    }
    inside.len()
}

struct Members<'n, 'v, 'a> {
    names: &'n [&'n str],
    values: &'v mut [Option<&'a RawValue>],
}

impl<'a> DeserializeSeed<'a> for Members<'_, '_, 'a> {
    type Value = ();

    fn deserialize<D: Deserializer<'a>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'a> Visitor<'a> for Members<'_, '_, 'a> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'a>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(index) = map.next_key_seed(Name(self.names))? {
            let value: &'a RawValue = map.next_value()?;
            if let Some(slot) = index.and_then(|index| self.values.get_mut(index)) {
                *slot = Some(value);
            }
        }
        Ok(())
    }
}

/// Reads a key as its index among the names; `None` for any other key.
struct Name<'n>(&'n [&'n str]);

impl<'a> DeserializeSeed<'a> for Name<'_> {
    type Value = Option<usize>;

    fn deserialize<D: Deserializer<'a>>(self, deserializer: D) -> Result<Option<usize>, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Name<'_> {
    type Value = Option<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, key: &str) -> Result<Option<usize>, E> {
        Ok(self.0.iter().position(|name| *name == key))
    }
}

/// The index of the first byte from `at` on that `wanted` accepts.
pub(super) fn next_of(bytes: &[u8], at: usize, wanted: impl Fn(u8) -> bool) -> Option<usize> {
    let rest = bytes.get(at..)?;
    rest.iter()
        .position(|&byte| wanted(byte))
        .map(|offset| at + offset)
}

/// The index behind the string that opens at `open`; the end of the text where it does not close.
pub(super) fn string_end(bytes: &[u8], open: usize) -> usize {
    let mut at = open + 1;
    while let Some(found) = next_of(bytes, at, |byte| matches!(byte, b'"' | b'\\')) {
        if bytes.get(found) == Some(&b'"') {
            return found + 1;
        }
        at = found + 2;
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A client may send a million entries where two belong.
    #[test]
    fn no_more_entries_are_kept_than_were_asked_for_but_all_are_counted() {
        let raw = RawValue::from_string("[1,2,3,4]".to_owned()).unwrap();
        let entries = entries(&raw, 2).unwrap();
        let first: Vec<&str> = entries.first.iter().map(|entry| entry.get()).collect();
        assert_eq!((first, entries.count), (vec!["1", "2"], 4));
        assert_eq!(entries.last.map(RawValue::get), Some("4"));
    }

    #[test]
    fn entries_end_at_commas_of_their_own_array_alone() {
        let found = |text: &str| {
            let raw = RawValue::from_string(text.to_owned()).unwrap();
            let entries = entries(&raw, 9)?;
            assert_eq!(
                entries.last.map(RawValue::get),
                entries.first.last().map(|raw| raw.get())
            );
            assert_eq!(entries.count, entries.first.len());
            Some(
                entries
                    .first
                    .iter()
                    .map(|entry| entry.get().to_owned())
                    .collect::<Vec<_>>(),
            )
        };
        let texts = |texts: &[&str]| Some(texts.iter().map(ToString::to_string).collect());
        assert_eq!(found("[]"), texts(&[]));
        assert_eq!(found("[ \n ]"), texts(&[]));
        assert_eq!(found("[ 1 ]"), texts(&["1"]));
        assert_eq!(
            found(r#"[ "a,\"]", [1,[2,3]] ,{"b":[4,5],"c,]":6}, "\\", -7e1 ]"#),
            texts(&[
                r#""a,\"]""#,
                "[1,[2,3]]",
                r#"{"b":[4,5],"c,]":6}"#,
                r#""\\""#,
                "-7e1"
            ])
        );
        for other in [r#""[1]""#, "{}", "1", "null"] {
            assert_eq!(found(other), None);
        }
    }
}
