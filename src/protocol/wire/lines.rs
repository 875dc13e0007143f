//! The messages in frames that go out: each line of a series is one, and anything else is one as a whole.
//!
//! **Invariant:** frames are divided only where a message ends.

use bytes::Bytes;

use super::series::{HEAD, MAX_SERIES};

/// The length of the first message of frames for one client: one line of a series, or all of anything else
/// (fragments, binary, or more bytes than a series has). Only up to 64 KiB are searched.
#[must_use]
pub fn first_message(frames: &[u8]) -> usize {
    first_messages(frames, 0).0
}

/// The length and number of the first messages of frames for one client that have at least `bytes` bytes together:
/// at least one, at most all.
#[must_use]
pub fn first_messages(frames: &[u8], bytes: usize) -> (usize, usize) {
    if frames.len() > MAX_SERIES || !frames.starts_with(HEAD) {
        return (frames.len(), 1);
    }
    let from = bytes.saturating_sub(1).min(frames.len());
    let (before, behind) = frames.split_at(from);
    let end = behind.iter().position(|byte| *byte == b'\n');
    let end = end.map_or(frames.len(), |end| from + end + 1);
    (end, lines(before) + 1)
}

/// The number of line ends in `bytes`. They are counted in chunks whose count fits into a byte, which compiles to much
/// faster code.
fn lines(bytes: &[u8]) -> usize {
    let ends = |part: &[u8]| part.iter().map(|byte| u8::from(*byte == b'\n')).sum::<u8>();
    let parts = bytes.chunks(u8::MAX.into());
    parts.map(|part| usize::from(ends(part))).sum()
}

/// The last messages of a series, at most `count`.
#[must_use]
pub fn last_messages(mut frames: Bytes, count: usize) -> Bytes {
    // The part after the last line end is empty.
    let before = frames
        .rsplitn(count + 2, |byte| *byte == b'\n')
        .nth(count + 1);
    let start = before.map_or(0, |before| before.len() + 1);
    frames.split_off(start)
}

/// Each message of `frames`.
pub fn messages(mut frames: Bytes) -> impl Iterator<Item = Bytes> {
    std::iter::from_fn(move || {
        (!frames.is_empty()).then(|| frames.split_to(first_message(&frames)))
    })
}

/// A message that does not keep the others of its series in memory: a copy if it `is_part` of one.
#[must_use]
pub fn by_itself(message: Bytes, is_part: bool) -> Bytes {
    if is_part {
        Bytes::copy_from_slice(&message)
    } else {
        message
    }
}
