//! JSON: the members of an object, values, and payloads that are passed on.
//!
//! Python's `json` writes `NaN`, `Infinity` and `-Infinity`, and any client may write `1e999`. In the input, these
//! names become literals that overflow (`literals.rs`). So the parser accepts the frame, [`number`] returns a
//! non-finite value, and the field's reader rejects it by name. In forwarded payloads a number that overflows becomes
//! `null`.
//!
//! **Invariant:** a fixed number of passes over any text. A [`Payload`] is checked when it comes. Its text is
//! one line of valid JSON, ready to be copied.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Serialize, Serializer};
use serde_json::value::RawValue;

pub use super::literals::{accept_literals, strict};

// ---- the members of an object, read in one pass ---------------------------------------------------------------------

/// Reads the JSON object `text`, and puts into `values` the raw value of each of `names`. Of repeated keys the last one
/// counts. Of other members only the syntax is checked. `values` is as long as `names`.
///
/// # Errors
/// If `text` is not one valid JSON object. The reason does not quote a string, because escaping it would take fifty
/// times as long as reading it.
pub(crate) fn members_into<'a>(
    text: &'a str,
    names: &[&str],
    values: &mut [Option<&'a RawValue>],
) -> Result<(), serde_json::Error> {
    if text.trim_ascii_start().starts_with('"') {
        return Err(serde::de::Error::custom("a string, not an object"));
    }
    let mut deserializer = serde_json::Deserializer::from_str(text);
    NamedValues { names, values }.deserialize(&mut deserializer)?;
    deserializer.end()
}

/// Reads the values of some names out of an object.
struct NamedValues<'n, 'v, 'a> {
    names: &'n [&'n str],
    values: &'v mut [Option<&'a RawValue>],
}

impl<'a> DeserializeSeed<'a> for NamedValues<'_, '_, 'a> {
    type Value = ();

    fn deserialize<D: Deserializer<'a>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'a> Visitor<'a> for NamedValues<'_, '_, 'a> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'a>>(self, mut map: A) -> Result<(), A::Error> {
        // A key that is not valid text is an unknown one.
        while let Some(key) = map.next_key()?.map(text) {
            let value: &'a RawValue = map.next_value()?;
            let index = key.and_then(|key| self.names.iter().position(|name| *name == key));
            if let Some(slot) = index.and_then(|index| self.values.get_mut(index)) {
                *slot = Some(value);
            }
        }
        Ok(())
    }
}

// ---- values ---------------------------------------------------------------------------------------------------------

/// The text of a JSON string; `None` if `raw` is not a string, or if it has half of a surrogate pair, which is
/// not valid text.
#[must_use]
pub fn text(raw: &RawValue) -> Option<Cow<'_, str>> {
    let quoted = raw.get();
    let inner = quoted.strip_prefix('"')?.strip_suffix('"')?;
    if inner.contains('\\') {
        return serde_json::from_str(quoted).ok().map(Cow::Owned);
    }
    Some(Cow::Borrowed(inner))
}

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

// ---- JSON that is passed on or echoed: ids, messages, arguments, answers --------------------------------------------

/// A JSON value as a client sent it. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Payload(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    raw: Box<RawValue>,
    /// The text as it is written, if it differs from what came.
    line: Option<Box<RawValue>>,
}

impl Payload {
    /// `{}`.
    #[must_use]
    pub fn empty_object() -> Self {
        let object = RawValue::from_string("{}".to_owned());
        object.unwrap_or_default().into()
    }

    /// The unchanged value: numbers that overflow are still there, so that a reader can refuse them by name.
    #[must_use]
    pub fn raw(&self) -> &RawValue {
        &self.0.raw
    }

    /// The unchanged text.
    #[must_use]
    pub fn get(&self) -> &str {
        self.0.raw.get()
    }

    /// Bytes that it takes, shared or not: its text, the line if that is another text, and what keeps them.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let counts = 2 * size_of::<usize>();
        let line = self.0.line.as_ref().map_or(0, |line| line.get().len());
        counts + size_of::<Inner>() + self.get().len() + line
    }

    /// The text as it is written: [strict], on one line.
    #[must_use]
    pub fn line(&self) -> &str {
        self.written().get()
    }

    fn written(&self) -> &RawValue {
        self.0.line.as_ref().unwrap_or(&self.0.raw)
    }
}

impl From<Box<RawValue>> for Payload {
    fn from(raw: Box<RawValue>) -> Self {
        let strict = strict(raw.get());
        // Valid JSON has line ends between tokens only. Some readers treat a carriage return as a line end. They would
        // read the text between two of them as a frame.
        let line = match strict {
            text if text.contains('\r') || text.contains('\n') => {
                Some(text.replace(['\r', '\n'], " "))
            }
            Cow::Owned(text) => Some(text),
            Cow::Borrowed(_) => None,
        };
        let line = line.and_then(|line| RawValue::from_string(line).ok());
        Self(Arc::new(Inner { raw, line }))
    }
}

impl From<&RawValue> for Payload {
    fn from(raw: &RawValue) -> Self {
        raw.to_owned().into()
    }
}

/// As it is written.
impl Serialize for Payload {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.written().serialize(serializer)
    }
}

impl PartialEq for Payload {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Eq for Payload {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_counts_if_it_is_another_text() {
        let read = |text: &str| Payload::from(RawValue::from_string(text.to_owned()).unwrap());
        let (short, long) = (read("[1,2]"), read("[1,\n2]"));
        assert_ne!(long.get(), long.line());
        let more = long.get().len() - short.get().len() + long.line().len();
        assert_eq!(long.allocated(), short.allocated() + more);
        assert!(short.allocated() > short.get().len());
    }

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
