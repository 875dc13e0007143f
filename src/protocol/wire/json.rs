//! JSON that is passed on: the members of an object, and payloads, strict about numbers.
//!
//! In forwarded payloads a number that overflows becomes `null`. `values.rs` has the values that the runtime reads
//! itself.
//!
//! **Invariant:** a fixed number of passes over any text. A [`Payload`] is checked when it comes. Its text is
//! one line of valid JSON, ready to be copied.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::fmt;
use std::iter::repeat;
use std::sync::Arc;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde::{Serialize, Serializer};
use serde_json::value::RawValue;

pub(crate) use super::values::{Entries, INFINITY, NAN, entries, for_each};
pub use super::values::{accept_literals, boolean, integer, number};

/// Digits of the largest finite `f64` before the point. A shorter number without an exponent cannot overflow.
const SAFE_DIGITS: usize = OVERFLOW.len() - 1;
/// The least number that rounds to infinity: 2^1024 - 2^970, halfway between the largest `f64` and the next power of
/// two.
const OVERFLOW: &[u8; 309] = b"\
    1797693134862315807937289714053034150799341327100378269361737789804449682927647509466490179775872070963\
    3028641669288791094655554785194040263065748867150582068190890200070838367627385484581771153176447573027\
    0069855571366959622842914819860834936475292719074168444365510704342711559699508093042880177904174497792";

/// Replaces every number that overflows an `f64` by `null`. All other bytes of the valid JSON text `raw` do not change.
#[must_use]
pub fn strict(raw: &str) -> Cow<'_, str> {
    let checked = |bytes: &[u8], at| {
        let end = next_of(bytes, at, |byte| !is_numeric(byte)).unwrap_or(bytes.len());
        let overflows = overflows(bytes.get(at..end).unwrap_or_default());
        (end, overflows.then_some("null"))
    };
    let strict = replaced(raw, |byte| matches!(byte, b'-' | b'0'..=b'9'), checked);
    strict.map_or(Cow::Borrowed(raw), Cow::Owned)
}

/// The text with other tokens outside strings; `None` if nothing changes. `token` returns the end of the token at a byte
/// that `begins` accepts, and what replaces it.
pub(super) fn replaced(
    text: &str,
    begins: impl Fn(u8) -> bool,
    token: impl Fn(&[u8], usize) -> (usize, Option<&'static str>),
) -> Option<String> {
    let bytes = text.as_bytes();
    let mut output = String::new();
    let (mut copied, mut at) = (0, 0);
    while let Some(found) = next_of(bytes, at, |byte| byte == b'"' || begins(byte)) {
        let (end, replacement) = match bytes.get(found) {
            Some(b'"') => (string_end(bytes, found), None),
            _ => token(bytes, found),
        };
        at = end;
        if let Some(replacement) = replacement {
            output.push_str(text.get(copied..found).unwrap_or_default());
            output.push_str(replacement);
            copied = end;
        }
    }
    (copied > 0).then(|| output + text.get(copied..).unwrap_or_default())
}

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

const fn is_numeric(byte: u8) -> bool {
    matches!(byte, b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E')
}

/// Whether a JSON number rounds to infinity, from its digits and its exponent, in one pass. Parsing it to an `f64`
/// may be hundreds of times slower, if it is close to halfway between two doubles.
fn overflows(token: &[u8]) -> bool {
    let exponent_at = token.iter().position(|byte| matches!(byte, b'e' | b'E'));
    if exponent_at.is_none() && token.len() <= SAFE_DIGITS {
        return false;
    }
    let (mantissa, exponent) = token.split_at(exponent_at.unwrap_or(token.len()));
    let mantissa = mantissa.strip_prefix(b"-").unwrap_or(mantissa);
    let point = mantissa.iter().position(|byte| *byte == b'.');
    let point = point.unwrap_or(mantissa.len());
    let Some(first) = mantissa.iter().position(|byte| matches!(byte, b'1'..=b'9')) else {
        return false;
    };
    // The number of digits before the point after applying the exponent; 0 or less if zeros follow the point.
    let zeros = mantissa.iter().take(first).filter(|byte| **byte == b'0');
    let shift = whole(point) - whole(zeros.count());
    match shift
        .saturating_add(power(exponent))
        .cmp(&whole(OVERFLOW.len()))
    {
        Ordering::Less => false,
        Ordering::Greater => true,
        Ordering::Equal => {
            let digits = mantissa.iter().skip(first).filter(|byte| **byte != b'.');
            digits
                .chain(repeat(&b'0'))
                .take(OVERFLOW.len())
                .ge(OVERFLOW)
        }
    }
}

/// The value of an exponent with its `e`. Saturates; 0 if there is none.
fn power(exponent: &[u8]) -> i64 {
    let digits = exponent.iter().filter(|byte| byte.is_ascii_digit());
    let value = digits.fold(0_i64, |value, digit| {
        value
            .saturating_mul(10)
            .saturating_add(i64::from(digit - b'0'))
    });
    if exponent.contains(&b'-') {
        -value
    } else {
        value
    }
}

fn whole(length: usize) -> i64 {
    i64::try_from(length).unwrap_or(i64::MAX)
}

// ---- the members of an object and the entries of an array, read in one pass -----------------------------------------

/// Reads the JSON object `text` and returns, for each of `names`, the raw value of that key. Of repeated keys the last
/// one counts. Of other members only the syntax is checked.
///
/// # Errors
/// If `text` is not one valid JSON object. The reason does not quote a string, because escaping it would take fifty
/// times as long as reading it.
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

/// The index of the first byte from `at` on that `wanted` accepts.
fn next_of(bytes: &[u8], at: usize, wanted: impl Fn(u8) -> bool) -> Option<usize> {
    let rest = bytes.get(at..)?;
    rest.iter()
        .position(|&byte| wanted(byte))
        .map(|offset| at + offset)
}

/// The index after the string that begins at `open`; the end of the text if it is not closed.
pub(crate) fn string_end(bytes: &[u8], open: usize) -> usize {
    let mut at = open + 1;
    while let Some(found) = next_of(bytes, at, |byte| matches!(byte, b'"' | b'\\')) {
        if bytes.get(found) == Some(&b'"') {
            return found + 1;
        }
        at = found + 2;
    }
    bytes.len()
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
}
