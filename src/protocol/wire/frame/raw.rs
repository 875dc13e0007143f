//! A frame: cut out of the stream, read as text, or refused.
//!
//! **Invariant:** a frame that was cut out of the stream is decoded once, and only then known to be text.

use crate::protocol::limits::MAX_NESTING;
use crate::protocol::wire::json;
use crate::protocol::wire::series::Series;

/// One JSON object, as text. Its syntax within the outer braces is still unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The text, with `NaN` and its like made [acceptable](json::accept_literals).
    pub text: String,
    /// Whether a line end was seen right behind it. Older raw-TCP clients send none, and want each frame in a write of
    /// its own.
    pub newline: bool,
}

/// Why a stretch of the stream is no frame. Nothing inside it is executed; later frames work.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// Something other than `{` began the line; holds the beginning of it.
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
    /// A `]` came where `}` was due, or the reverse.
    #[error("malformed frame: {found} closes what {opener} opened")]
    Mismatch {
        /// The bracket that opened the innermost level.
        opener: char,
        /// The bracket that was to close it.
        found: char,
    },
    /// More than [`MAX_NESTING`] levels.
    #[error("malformed frame: nested deeper than {MAX_NESTING} levels")]
    TooDeep,
    /// Something stood behind the object of a message that holds one.
    #[error("malformed frame: a message holds one JSON object, and something stood behind it")]
    MoreBehind,
    /// Longer than the limit, which it holds: [`MAX_FRAME`](crate::protocol::limits::MAX_FRAME) unless the reader has
    /// another.
    #[error("frame longer than {0} bytes, skipped")]
    TooLong(usize),
    /// Not UTF-8.
    #[error("malformed frame: byte {at} is not UTF-8")]
    NotUtf8 {
        /// Index of the first bad byte within the frame.
        at: usize,
    },
}

/// The next part of a stream.
#[derive(Debug)]
pub enum FramePart {
    /// Messages of a client on a topic of clients that can go out as they are.
    Lines(Series),
    /// Any other frame.
    Frame(RawFrame),
    /// A stretch that is no frame, and its first bytes, at most [`KEPT_START`] of them.
    Error(FrameError, Vec<u8>),
}

/// Bytes that are kept from the start of a frame that cannot be read: they hold the names and the id by which the call
/// that it answers is found.
pub const KEPT_START: usize = 1024;

/// The bytes that are kept of the start of a frame that cannot be read.
pub(in crate::protocol::wire) fn start_of(bytes: &[u8]) -> Vec<u8> {
    bytes.get(..KEPT_START).unwrap_or(bytes).to_vec()
}

/// A [`Frame`] whose bytes nobody has looked at but to find its end: reading on may be left to another thread.
#[derive(Debug)]
pub struct RawFrame {
    pub(super) bytes: Vec<u8>,
    /// Whether there may be names of numbers that are not finite.
    pub(super) has_literals: bool,
    pub(super) newline: bool,
}

impl RawFrame {
    /// How long it is, in bytes; never 0.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "it has two braces at least")]
    pub const fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether a line end was seen right behind it.
    #[must_use]
    pub const fn newline(&self) -> bool {
        self.newline
    }

    /// The frame.
    ///
    /// # Errors
    /// If it is not UTF-8; with the frame's first bytes.
    pub fn decode(self) -> Result<Frame, (FrameError, Vec<u8>)> {
        let text = String::from_utf8(self.bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            (FrameError::NotUtf8 { at }, start_of(error.as_bytes()))
        })?;
        let text = if self.has_literals {
            json::accept_literals(text)
        } else {
            text
        };
        let newline = self.newline;
        Ok(Frame { text, newline })
    }
}
