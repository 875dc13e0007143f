//! JSON as it is met in the wild: lenient about numbers coming in, strict about numbers going out.
//!
//! Python's `json` writes `NaN`, `Infinity` and `-Infinity`, and anybody may write `1e999`. Coming in, the names become
//! literals that overflow, so that the parser takes the frame and [`number`] gives a non-finite value for the field's
//! reader to reject by name. Going out, in payloads that only pass through, whatever overflows becomes `null`.
//!
//! **Invariant:** one pass, linear in the length of the text, whatever the text is.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::iter::repeat;

use serde_json::value::RawValue;

pub(crate) use super::parts::{Entries, entries, members, members_into};
use super::parts::{next_of, string_end};

/// The text that replaces `NaN` on the way in. It reads as an infinity: nothing that we accept tells the two apart.
pub(crate) const NAN: &str = "9e999";
/// The text that replaces `Infinity` on the way in; the sign before it stays.
pub(crate) const INFINITY: &str = "1e999";
/// Digits of the largest finite `f64` before the point: a number of fewer, without an exponent, can't overflow.
const SAFE_DIGITS: usize = OVERFLOW.len() - 1;
/// The least number that rounds to infinity: 2^1024 - 2^970, halfway between the largest `f64` and the next power of
/// two.
const OVERFLOW: &[u8; 309] = b"\
    1797693134862315807937289714053034150799341327100378269361737789804449682927647509466490179775872070963\
    3028641669288791094655554785194040263065748867150582068190890200070838367627385484581771153176447573027\
    0069855571366959622842914819860834936475292719074168444365510704342711559699508093042880177904174497792";

/// Makes `NaN`, `Infinity` and `-Infinity` (outside strings, as whole tokens) literals that overflow; the rest is
/// untouched.
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
        if overflows(bytes.get(found..at).unwrap_or_default()) {
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

/// Whether `name` stands at `at`, with nothing around it that would make it part of a longer token (`1Infinity`,
/// `NaNs`).
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

/// Whether a JSON number rounds to infinity, by its digits and its exponent, in one pass. To make an `f64` of it may
/// take as long as three hundred of its bytes, if it lies close to halfway between two.
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
    // How many digits stand before the point once the exponent has moved it; 0 or less where zeros follow the point.
    let shift = if first < point {
        whole(point - first)
    } else {
        -whole(first - point - 1)
    };
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

/// The value of an exponent, its `e` included; saturates, and is 0 where there is none.
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
