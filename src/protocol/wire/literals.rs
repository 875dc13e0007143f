//! Numbers that are not finite, in JSON text. In the input, `NaN` and `Infinity` become numbers that overflow. In the
//! output, numbers that overflow become `null`.
//!
//! **Invariant:** one pass, linear in the length of any text. Strings do not change.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::iter::repeat;

/// The text that replaces `NaN` in the input. It is read as infinity, because no valid input distinguishes the two.
pub(super) const NAN: &str = "9e999";
/// The text that replaces `Infinity` in the input. The sign before it stays.
pub(super) const INFINITY: &str = "1e999";
/// Digits of the largest finite `f64` before the point. A shorter number without an exponent cannot overflow.
const SAFE_DIGITS: usize = OVERFLOW.len() - 1;
/// The least number that rounds to infinity: 2^1024 - 2^970, halfway between the largest `f64` and the next power of
/// two.
const OVERFLOW: &[u8; 309] = b"\
    1797693134862315807937289714053034150799341327100378269361737789804449682927647509466490179775872070963\
    3028641669288791094655554785194040263065748867150582068190890200070838367627385484581771153176447573027\
    0069855571366959622842914819860834936475292719074168444365510704342711559699508093042880177904174497792";

/// Replaces `NaN`, `Infinity` and `-Infinity` (outside strings, as whole tokens) by literals that overflow. The
/// rest does not change.
#[must_use]
pub fn accept_literals(text: String) -> String {
    let literal = |bytes: &[u8], at| {
        let (name, literal, is_signed) = match bytes.get(at) {
            Some(b'N') => ("NaN", NAN, false),
            _ => ("Infinity", INFINITY, true),
        };
        match whole_token(bytes, at, name, is_signed) {
            true => (at + name.len(), Some(literal)),
            false => (at + 1, None),
        }
    };
    let accepted = replaced(&text, |byte| matches!(byte, b'N' | b'I'), literal);
    accepted.unwrap_or(text)
}

/// Whether `name` is a whole token at `at`, and not part of a longer one (`1Infinity`, `NaNs`).
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

// ---- tokens outside strings -----------------------------------------------------------------------------------------

/// The text with other tokens outside strings; `None` if nothing changes. `token` returns the end of the token at a
/// byte that `begins` accepts, and what replaces it.
fn replaced(
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
