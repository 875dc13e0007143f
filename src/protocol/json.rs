//! JSON as it is met in the wild: lenient about numbers coming in, strict about numbers going out.
//!
//! Python's `json` writes `NaN`, `Infinity` and `-Infinity`, and anybody may write `1e999`. Coming in, the names become
//! literals that overflow, so that the parser takes the frame and [`number`] gives a non-finite value for the field's reader
//! to reject by name. Going out, in payloads that only pass through, whatever overflows becomes `null`.
//!
//! **Invariant:** one pass, linear in the length of the text, whatever the text is.

use std::borrow::Cow;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

/// What `NaN` becomes on the way in. Reads as an infinity: nothing that we accept tells the two apart.
pub(super) const NAN: &str = "9e999";
/// What `Infinity` becomes on the way in; the sign before it stays.
pub(super) const INFINITY: &str = "1e999";
/// The largest finite `f64` has 309 digits: a number of fewer, without an exponent, can't overflow.
const SAFE_DIGITS: usize = 308;

/// Makes `NaN`, `Infinity` and `-Infinity` (outside strings, as whole tokens) literals that overflow; the rest is untouched.
#[must_use]
pub fn accept_literals(text: String) -> String {
    let bytes = text.as_bytes();
    let mut accepted = String::new();
    let mut copied = 0;
    let mut at = 0;
    while let Some(found) = next_of(bytes, at, |byte| matches!(byte, b'"' | b'N' | b'I')) {
        let literal = match bytes.get(found) {
            Some(b'"') => {
                at = string_end(bytes, found);
                continue;
            }
            Some(b'N') => whole_token(bytes, found, "NaN", false).then_some(("NaN", NAN)),
            _ => whole_token(bytes, found, "Infinity", true).then_some(("Infinity", INFINITY)),
        };
        at = found + 1;
        if let Some((name, literal)) = literal {
            accepted.push_str(text.get(copied..found).unwrap_or_default());
            accepted.push_str(literal);
            at = found + name.len();
            copied = at;
        }
    }
    if copied == 0 {
        return text;
    }
    accepted.push_str(text.get(copied..).unwrap_or_default());
    accepted
}

/// Replaces every number that overflows an `f64` by `null`; all other bytes of the valid JSON text `raw` are untouched.
#[must_use]
pub fn strict(raw: &str) -> Cow<'_, str> {
    let bytes = raw.as_bytes();
    let mut output = String::new();
    let mut copied = 0;
    let mut at = 0;
    while let Some(found) = next_of(bytes, at, |byte| matches!(byte, b'"' | b'-' | b'0'..=b'9')) {
        if bytes.get(found) == Some(&b'"') {
            at = string_end(bytes, found);
            continue;
        }
        at = next_of(bytes, found, |byte| !is_numeric(byte)).unwrap_or(bytes.len());
        let token = raw.get(found..at).unwrap_or_default();
        if overflows(token) {
            output.push_str(raw.get(copied..found).unwrap_or_default());
            output.push_str("null");
            copied = at;
        }
    }
    if copied == 0 {
        return Cow::Borrowed(raw);
    }
    output.push_str(raw.get(copied..).unwrap_or_default());
    Cow::Owned(output)
}

/// The value of a JSON number, infinite where the literal overflows; `None` if `raw` is not a number.
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

/// The text of a JSON string; `None` if `raw` is none, or if it holds half a surrogate pair, which is no text.
#[must_use]
pub fn text(raw: &RawValue) -> Option<Cow<'_, str>> {
    let quoted = raw.get();
    let inner = quoted.strip_prefix('"')?.strip_suffix('"')?;
    if inner.contains('\\') {
        return serde_json::from_str(quoted).ok().map(Cow::Owned);
    }
    Some(Cow::Borrowed(inner))
}

/// Reads the JSON object `text` and gives, for each of `names`, the raw value under that key: the last one where a key is
/// repeated. Other members are checked for syntax and ignored.
///
/// # Errors
/// Where `text` is not one valid JSON object.
pub(super) fn members<'a, const N: usize>(
    text: &'a str,
    names: &[&str; N],
) -> Result<[Option<&'a RawValue>; N], serde_json::Error> {
    let mut values = [None; N];
    members_into(text, names, &mut values)?;
    Ok(values)
}

/// [`members`] for a list of names whose length is known at run time; `values` is as long as `names`.
pub(super) fn members_into<'a>(
    text: &'a str,
    names: &[&str],
    values: &mut [Option<&'a RawValue>],
) -> Result<(), serde_json::Error> {
    let mut deserializer = serde_json::Deserializer::from_str(text);
    Members { names, values }.deserialize(&mut deserializer)?;
    deserializer.end()
}

/// A JSON array, read no further than it has to be.
pub(super) struct Entries<'a> {
    /// The first entries, at most as many as were asked for.
    pub(super) first: Vec<&'a RawValue>,
    /// The last entry.
    pub(super) last: Option<&'a RawValue>,
    /// How many entries there are.
    pub(super) count: usize,
}

/// Reads the array `raw`, keeping at most `limit` entries: a long array costs time, not memory. `None` if it is no array.
pub(super) fn entries(raw: &RawValue, limit: usize) -> Option<Entries<'_>> {
    let mut deserializer = serde_json::Deserializer::from_str(raw.get());
    deserializer.deserialize_seq(Limit(limit)).ok()
}

struct Limit(usize);

impl<'a> Visitor<'a> for Limit {
    type Value = Entries<'a>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON array")
    }

    fn visit_seq<A: SeqAccess<'a>>(self, mut seq: A) -> Result<Entries<'a>, A::Error> {
        let mut entries = Entries {
            first: Vec::new(),
            last: None,
            count: 0,
        };
        while let Some(entry) = seq.next_element::<&'a RawValue>()? {
            if entries.count < self.0 {
                entries.first.push(entry);
            }
            entries.last = Some(entry);
            entries.count += 1;
        }
        Ok(entries)
    }
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
fn next_of(bytes: &[u8], at: usize, wanted: impl Fn(u8) -> bool) -> Option<usize> {
    let rest = bytes.get(at..)?;
    rest.iter()
        .position(|&byte| wanted(byte))
        .map(|offset| at + offset)
}

/// The index behind the string that opens at `open`; the end of the text where it does not close.
fn string_end(bytes: &[u8], open: usize) -> usize {
    let mut at = open + 1;
    while let Some(found) = next_of(bytes, at, |byte| matches!(byte, b'"' | b'\\')) {
        if bytes.get(found) == Some(&b'"') {
            return found + 1;
        }
        at = found + 2;
    }
    bytes.len()
}

/// Whether `name` stands at `at`, with nothing around it that would make it part of a longer token (`1Infinity`, `NaNs`).
fn whole_token(bytes: &[u8], at: usize, name: &str, signed: bool) -> bool {
    let before = |back: usize| at.checked_sub(back).and_then(|index| bytes.get(index));
    let sign = usize::from(signed && before(1) == Some(&b'-'));
    bytes
        .get(at..)
        .is_some_and(|rest| rest.starts_with(name.as_bytes()))
        && !before(1 + sign).is_some_and(|byte| is_token(*byte))
        && !bytes
            .get(at + name.len())
            .is_some_and(|byte| is_token(*byte))
}

const fn is_token(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.' | b'+' | b'-')
}

const fn is_numeric(byte: u8) -> bool {
    matches!(byte, b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E')
}

fn overflows(token: &str) -> bool {
    let suspect =
        token.len() > SAFE_DIGITS || token.bytes().any(|byte| matches!(byte, b'e' | b'E'));
    suspect && token.parse::<f64>().is_ok_and(f64::is_infinite)
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
}
