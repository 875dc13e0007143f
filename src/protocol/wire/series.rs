//! Messages that can go out as they have come in: a series of `publish` frames on one topic, line behind line, each
//! spelled as the runtime itself would spell it.
//!
//! Most programs write their JSON that way, and a flood of messages is all of this kind. Such a line is checked in
//! one pass and passed on as it is; nothing of it is taken apart and put together again.
//!
//! **Invariant:** a series is passed on as the general reader and writer would have done it, byte for byte. A
//! doubtful message is left to those.

use bytes::Bytes;

use crate::protocol::catalog::Topic;
use crate::protocol::limits::MAX_NAME;

/// Bytes of a series: enough to make little of what a series costs besides its bytes, few enough to be fair to other
/// clients.
pub const MAX_SERIES: usize = 64 * 1024;

/// How a message begins that is one of a series.
const HEAD: &[u8] = b"{\"op\":\"publish\",\"topic\":\"";
/// The text between topic and message, the latter's brace included.
const MIDDLE: &[u8] = b"\",\"msg\":{";
/// The text behind the message's closing brace.
const END: &[u8] = b"}\n";
/// Longest number whose value is certainly finite: the largest `f64` has 309 digits.
const MAX_DIGITS: usize = 308;
/// Levels that are kept in one word, the message itself included. A deeper message goes the general
/// way.
const MAX_LEVELS: u32 = 60;

/// Messages of a client on a topic of clients, one behind the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Series {
    /// The topic, as it is spelled in the frames: with a slash in front.
    pub topic: Box<str>,
    /// The frames, each with its newline.
    pub frames: Bytes,
}

/// The series that `bytes` begin with: its topic, and how long it is. `None` where they do not begin with a whole
/// message of one.
pub(super) fn leading(bytes: &[u8]) -> Option<(&str, usize)> {
    // A longer line is no series: no more is looked at to find that out.
    let bytes = bytes.get(..MAX_SERIES).unwrap_or(bytes);
    let name = bytes.strip_prefix(HEAD)?;
    let end = name
        .iter()
        .take(MAX_NAME + 1)
        .position(|byte| *byte == b'"')?;
    let topic = name.get(..end)?;
    let is_plain = |byte: &u8| (b' '..0x7f).contains(byte) && *byte != b'\\';
    if !topic.starts_with(b"/") || !topic.iter().all(is_plain) {
        return None;
    }
    let topic = std::str::from_utf8(topic).ok()?;
    let head = bytes.get(..HEAD.len() + end + MIDDLE.len())?;
    if !head.ends_with(MIDDLE) || Topic::from_name(topic).is_some() {
        return None;
    }
    let mut length = 0;
    while let Some(whole) = bytes.get(length..).and_then(|rest| message(rest, head)) {
        length += whole;
    }
    (length > 0).then_some((topic, length))
}

/// How long the first message of frames for one client is: one line of a series, all of anything else (fragments,
/// binary, or more bytes than a series has). A message of megabytes takes no longer.
#[must_use]
pub fn first_message(frames: &[u8]) -> usize {
    if frames.len() > MAX_SERIES || !frames.starts_with(HEAD) {
        return frames.len();
    }
    let end = frames.iter().position(|byte| *byte == b'\n');
    end.map_or(frames.len(), |end| end + 1)
}

/// The last message of a series.
#[must_use]
pub fn last_message(mut frames: Bytes) -> Bytes {
    // A message ends with a newline, its own.
    let before = frames.len().saturating_sub(1);
    let before = frames.get(..before).unwrap_or_default();
    let end = before.iter().rposition(|byte| *byte == b'\n');
    frames.split_off(end.map_or(0, |end| end + 1))
}

/// Each message of `frames` by itself.
pub fn messages(mut frames: Bytes) -> impl Iterator<Item = Bytes> {
    std::iter::from_fn(move || {
        (!frames.is_empty()).then(|| frames.split_to(first_message(&frames)))
    })
}

/// The length of the frame that `bytes` begin with, its newline included, if it has that head and is fit for a series.
fn message(bytes: &[u8], head: &[u8]) -> Option<usize> {
    if !bytes.starts_with(head) {
        return None;
    }
    let end = object(bytes, head.len())?;
    bytes.get(end..)?.starts_with(END).then(|| end + END.len())
}

/// Where the JSON object ends whose brace is right before `at`. `None` where it is not valid or not complete, and
/// where it needs a closer look: an escape, a byte beyond ASCII, an exponent, a number or a nesting of unusual
/// length.
fn object(bytes: &[u8], mut at: usize) -> Option<usize> {
    // One bit per open level, 1 for a bracket; the leading 1 marks how many there are.
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
                    levels = (levels << 1) | u64::from(byte == b'[');
                    if levels.leading_zeros() < u64::BITS - MAX_LEVELS {
                        return None;
                    }
                    fresh = true;
                    at += 1;
                    continue;
                }
                _ => word(bytes, at)?,
            };
            fresh = false;
        }
        // Behind a value, or where an empty object or array ends.
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

/// Goes past a key, its colon and the spaces around the colon.
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

/// Goes past `true`, `false` or `null`.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let rest = bytes.get(at..)?;
    let words: [&[u8]; 3] = [b"true", b"false", b"null"];
    let word = words.into_iter().find(|word| rest.starts_with(word))?;
    Some(at + word.len())
}

/// Goes past a number. It stops before an exponent, with which nothing begins that may follow a value.
fn number(bytes: &[u8], start: usize) -> Option<usize> {
    let mut at = start;
    if *bytes.get(at)? == b'-' {
        at += 1;
    }
    let whole = at;
    at = past_digits(bytes, at);
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
