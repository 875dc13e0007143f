//! Messages that can be forwarded unchanged: a series of `publish` frames on one topic, one per line, each spelled
//! as the runtime would write it.
//!
//! Compact JSON in the order `op`, `topic`, `msg` has this form. Such a line is checked in one pass.
//!
//! **Invariant:** a series is forwarded byte for byte as the general reader and writer would do it. All other
//! messages are left to these.

use bytes::Bytes;

use crate::protocol::catalog::Topic;
use crate::protocol::limits::MAX_NAME;

/// Most bytes of a series: enough that the cost per series is small, few enough to be fair to other clients.
pub const MAX_SERIES: usize = 64 * 1024;

/// The start of a message in a series.
pub(super) const HEAD: &[u8] = b"{\"op\":\"publish\",\"topic\":\"";
/// The text between the topic's quote and the message, including the message's brace.
const MIDDLE: &[u8] = b",\"msg\":{";
/// The text after the message's closing brace.
const END: &[u8] = b"}\n";
/// Longest number whose value is certainly finite: the largest `f64` has 309 digits.
const MAX_DIGITS: usize = 308;

/// Consecutive messages of a client on a topic of clients.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Series {
    /// The topic as spelled in the frames, with a leading slash.
    pub topic: Box<str>,
    /// The frames, each with its newline.
    pub frames: Bytes,
}

/// The series at the start of `bytes`. `None` if they do not begin with a whole message of a series.
pub(super) fn leading(bytes: &[u8]) -> Option<Series> {
    // A longer line is not a series, so no more bytes are read to check it.
    let bytes = bytes.get(..MAX_SERIES).unwrap_or(bytes);
    let name = bytes.strip_prefix(HEAD)?;
    let end = string(name, 0)?;
    let topic = std::str::from_utf8(name.get(..end - 1)?).ok()?;
    let head = bytes.get(..HEAD.len() + end + MIDDLE.len())?;
    let is_usual = topic.starts_with('/') && topic.len() <= MAX_NAME && head.ends_with(MIDDLE);
    if !is_usual || Topic::from_name(topic).is_some() {
        return None;
    }
    let mut length = 0;
    while let Some(whole) = bytes.get(length..).and_then(|rest| message(rest, head)) {
        length += whole;
    }
    let frames = bytes.get(..length).filter(|frames| !frames.is_empty())?;
    Some(Series {
        topic: topic.into(),
        // A copy, so it does not keep the stream's buffer in memory.
        frames: Bytes::copy_from_slice(frames),
    })
}

/// The length of the frame at the start of `bytes`, including its newline, if it has that head and is suitable for a
/// series.
fn message(bytes: &[u8], head: &[u8]) -> Option<usize> {
    if !bytes.starts_with(head) {
        return None;
    }
    let end = object(bytes, head.len())?;
    bytes.get(end..)?.starts_with(END).then(|| end + END.len())
}

/// The end of the JSON object whose brace is right before `at`. `None` if it is not valid or not complete, or if it
/// needs the general reader, for escapes, bytes beyond ASCII, exponents, very long numbers or very deep nesting.
fn object(bytes: &[u8], mut at: usize) -> Option<usize> {
    // One bit per open level, 1 for a bracket. The leading 1 marks their number. The general reader handles more levels.
    let mut levels: u64 = 0b10;
    let mut fresh = true;
    loop {
        let in_array = levels & 1 == 1;
        at = past_space(bytes, at);
        let mut byte = *bytes.get(at)?;
        let closer = if in_array { b']' } else { b'}' };
        if fresh && byte == closer {
            at += 1;
        } else {
            if !in_array {
                at = key(bytes, at)?;
                byte = *bytes.get(at)?;
            }
            at = match byte {
                b'"' => string(bytes, at + 1)?,
                b'-' | b'0'..=b'9' => number(bytes, at)?,
                b'{' | b'[' => {
                    levels = levels.checked_mul(2)? | u64::from(byte == b'[');
                    fresh = true;
                    at += 1;
                    continue;
                }
                _ => word(bytes, at)?,
            };
            fresh = false;
        }
        // After a value, or at the end of an empty object or array.
        loop {
            if !fresh {
                at = past_space(bytes, at);
                match *bytes.get(at)? {
                    b',' => {
                        at += 1;
                        break;
                    }
                    b']' if levels & 1 == 1 => at += 1,
                    b'}' if levels & 1 == 0 => at += 1,
                    _ => return None,
                }
            }
            fresh = false;
            levels >>= 1;
            if levels == 1 {
                return Some(at);
            }
        }
    }
}

/// Skips a key, its colon and the spaces around the colon.
fn key(bytes: &[u8], at: usize) -> Option<usize> {
    if *bytes.get(at)? != b'"' {
        return None;
    }
    let at = past_space(bytes, string(bytes, at + 1)?);
    (*bytes.get(at)? == b':').then(|| past_space(bytes, at + 1))
}

fn past_space(bytes: &[u8], mut at: usize) -> usize {
    while matches!(bytes.get(at), Some(b' ' | b'\t')) {
        at += 1;
    }
    at
}

/// Skips `true`, `false` or `null`.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let rest = bytes.get(at..)?;
    let words: [&[u8]; 3] = [b"true", b"false", b"null"];
    let word = words.into_iter().find(|word| rest.starts_with(word))?;
    Some(at + word.len())
}

/// Skips a number. It stops before an exponent, which then fails the check of the next token.
fn number(bytes: &[u8], start: usize) -> Option<usize> {
    let whole = start + usize::from(*bytes.get(start)? == b'-');
    let mut at = past_digits(bytes, whole);
    let has_leading_zero = at - whole > 1 && bytes.get(whole) == Some(&b'0');
    if at == whole || has_leading_zero {
        return None;
    }
    if *bytes.get(at)? == b'.' {
        let fraction = at + 1;
        at = past_digits(bytes, fraction);
        if at == fraction {
            return None;
        }
    }
    (at - start <= MAX_DIGITS).then_some(at)
}

/// Goes past the digits at `at`.
fn past_digits(bytes: &[u8], mut at: usize) -> usize {
    while matches!(bytes.get(at), Some(b'0'..=b'9')) {
        at += 1;
    }
    at
}

/// Goes past the end of a string of plain ASCII whose inside begins at `at`.
fn string(bytes: &[u8], at: usize) -> Option<usize> {
    let is_plain = |byte: &u8| matches!(byte, b' '..=b'!' | b'#'..=b'[' | b']'..=0x7f);
    let inside = bytes.get(at..)?;
    let end = at + inside.iter().position(|byte| !is_plain(byte))?;
    (*bytes.get(end)? == b'"').then_some(end + 1)
}
