//! Why a part of the stream is not a frame, and the bytes that are kept of it.
//!
//! **Invariant:** at most [`KEPT_START`] bytes are kept.

use std::string::FromUtf8Error;

use super::text;
use crate::protocol::limits::MAX_NESTING;

/// Bytes of a line that is not an object, kept for the error message.
pub(super) const MAX_PREFIX: usize = 32;
/// Bytes kept from the start of a frame that cannot be read. They contain the names and the id of the call that it may
/// answer.
pub const KEPT_START: usize = 1024;

/// Why a part of the stream is not a frame. Nothing inside it is executed, and later frames work.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The line does not begin with `{`; holds the beginning of it.
    #[error("malformed frame: a frame is one JSON object on one line, got \"{0}\"")]
    NotAnObject(String),
    /// A newline came before the object was complete.
    #[error("malformed frame: the line ended inside an object")]
    LineEnded,
    /// A newline came inside a string.
    #[error("malformed frame: the line ended inside a string")]
    LineEndedInString,
    /// The stream ended before the object was complete.
    #[error("malformed frame: the connection ended inside an object")]
    StreamEnded,
    /// A `]` in place of `}`, or the reverse.
    #[error("malformed frame: {found} does not close {opener}")]
    Mismatch {
        /// The bracket that opened the innermost level.
        opener: char,
        /// The bracket in place of the right one.
        found: char,
    },
    /// More than [`MAX_NESTING`] levels.
    #[error("malformed frame: nested deeper than {MAX_NESTING} levels")]
    TooDeep,
    /// Text after the one object of a message.
    #[error("malformed frame: a message must be one JSON object, but more text follows it")]
    MoreBehind,
    /// Longer than the limit, which it holds. The limit is [`MAX_FRAME`](crate::protocol::limits::MAX_FRAME), unless the reader has another.
    #[error("frame longer than {0} bytes, skipped")]
    TooLong(usize),
    /// Not UTF-8.
    #[error("malformed frame: byte {at} is not UTF-8")]
    NotUtf8 {
        /// Index of the first bad byte within the frame.
        at: usize,
    },
}

/// A frame that cannot be read: the reason, and its kept bytes.
pub(super) type Refused = (FrameError, Vec<u8>);

/// The kept bytes from the start of a frame that cannot be read.
pub(super) fn start_of(bytes: &[u8]) -> Vec<u8> {
    bytes.get(..KEPT_START).unwrap_or(bytes).to_vec()
}

/// A frame that is not UTF-8.
pub(super) fn not_utf8(error: &FromUtf8Error) -> Refused {
    let at = error.utf8_error().valid_up_to();
    (FrameError::NotUtf8 { at }, start_of(error.as_bytes()))
}

/// The error for a line that is not an object.
pub(super) fn not_an_object(line: &[u8]) -> FrameError {
    let prefix = line.get(..MAX_PREFIX).unwrap_or(line);
    let text = String::from_utf8_lossy(prefix.trim_ascii_end());
    let excerpt = text::excerpt(&text);
    let is_cut = prefix.len() == MAX_PREFIX;
    FrameError::NotAnObject(if is_cut { excerpt + "…" } else { excerpt })
}
