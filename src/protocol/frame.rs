//! Bytes into frames: an incremental reader that any split of the stream leaves unmoved, and that resynchronises.
//!
//! A frame is one JSON object. It ends where its braces and brackets balance outside strings, or at a newline. Anything else
//! runs to the newline and is one malformed frame.
//!
//! Messages that need no reading (see [`series`]) are taken as they are.
//!
//! **Invariant:** no byte is looked at more than twice, and no more is kept than one unfinished frame and what was last pushed.

use bytes::Bytes;

use super::json;
use super::nesting::{Event, Nesting};
pub use super::opening::{Foreign, Opening, is_host_line, opening};
use super::series::{self, Series};
use super::text;

/// Longest frame, in bytes without the newline: a 3-link trajectory has under 1 KiB, an expression of 1 MB has to pass.
pub const MAX_FRAME: usize = 4 * 1024 * 1024;
/// Deepest nesting of objects and arrays, the frame itself included: ROS messages need fewer than ten levels.
pub const MAX_NESTING: usize = 128;
/// Bytes of a line that is no object, kept for the error message.
const MAX_PREFIX: usize = 32;
/// Buffer that an idle reader may keep.
const KEPT_BUFFER: usize = 16 * 1024;

/// One JSON object, as text. Its syntax within the outer braces is still unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The text, with `NaN` and its like made [acceptable](json::accept_literals).
    pub text: String,
    /// Whether a line end was seen right behind it. Older raw-TCP clients send none, and want each frame in a write of its own.
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
    /// `]` where `}` was due, or the reverse.
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
    /// Longer than it may be, which is [`MAX_FRAME`] unless the reader has another limit; holds that.
    #[error("frame longer than {0} bytes, skipped")]
    TooLong(usize),
    /// Not UTF-8.
    #[error("malformed frame: byte {at} is not UTF-8")]
    NotUtf8 {
        /// Index of the first bad byte within the frame.
        at: usize,
    },
}

/// What the reader is in the middle of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Between frames: white space.
    Between,
    /// In an object that is kept.
    Object,
    /// In an object that has been reported already: on to where it would have ended.
    SkippedObject,
    /// In a line that is no object; its beginning is being collected.
    Line,
    /// In a line that has been reported already: on to the newline.
    SkippedLine,
}

/// Takes bytes as they come and gives frames, one at a time.
///
/// [`push`](Self::push) a chunk, then take frames with `next()` until it gives `None`; at the end of the stream,
/// [`finish`](Self::finish).
#[derive(Debug)]
pub struct FrameReader {
    buffer: Vec<u8>,
    /// Where the present frame starts in the buffer. What is before it has been handed out or skipped.
    start: usize,
    /// How far the buffer has been scanned.
    at: usize,
    state: State,
    nesting: Nesting,
    /// Longest frame.
    limit: usize,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// A reader at the beginning of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_limit(MAX_FRAME)
    }

    /// The same for frames of at most `limit` bytes.
    #[must_use]
    pub const fn with_limit(limit: usize) -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            at: 0,
            state: State::Between,
            nesting: Nesting::new(),
            limit,
        }
    }

    /// Adds bytes from the stream. Take all frames before the next push, so that memory stays bounded.
    pub fn push(&mut self, bytes: &[u8]) {
        self.compact();
        self.buffer.extend_from_slice(bytes);
    }

    /// The series of messages that the stream goes on with, if it does; to be asked for before the next frame is.
    pub fn series(&mut self) -> Option<Series> {
        if self.state != State::Between {
            return None;
        }
        let rest = self.rest();
        let space = rest.iter().position(|byte| !is_space(*byte))?;
        let rest = rest.get(space..)?;
        let (topic, length) = series::leading(rest)?;
        let series = Series {
            topic: topic.into(),
            // A copy of its own: whoever keeps it keeps nothing else of the stream.
            frames: Bytes::copy_from_slice(rest.get(..length)?),
        };
        self.at += space + length;
        self.start = self.at;
        Some(series)
    }

    /// How much memory the reader holds, in bytes.
    #[must_use]
    pub const fn buffered(&self) -> usize {
        self.buffer.capacity()
    }

    /// How many bytes are kept, in all.
    #[must_use]
    pub const fn kept(&self) -> usize {
        self.buffer.len()
    }

    /// Whether a frame has begun and not ended, one that is being skipped included.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        self.state != State::Between
    }

    /// Gives up the frame that has begun, once `next` gives none: the rest of it is skipped, as of one that is too long. False if
    /// there is none of which anything is kept.
    pub fn give_up(&mut self) -> bool {
        let skipped = match self.state {
            State::Object => State::SkippedObject,
            State::Line => State::SkippedLine,
            State::Between | State::SkippedObject | State::SkippedLine => return false,
        };
        self.state = skipped;
        self.start = self.at;
        self.give_back();
        true
    }

    /// The end of the stream, after the last frame was taken: an unfinished frame is one malformed frame.
    pub fn finish(&mut self) -> Option<FrameError> {
        let error = match self.state {
            State::Object => Some(FrameError::StreamEnded),
            State::Line => Some(self.not_an_object()),
            State::Between | State::SkippedObject | State::SkippedLine => None,
        };
        *self = Self::with_limit(self.limit);
        error
    }

    /// Moves what is unfinished to the front of the buffer, once what is done with has outgrown it: constant time per byte.
    fn compact(&mut self) {
        let rest = self.buffer.len() - self.start;
        if self.start < rest {
            return;
        }
        self.buffer.copy_within(self.start.., 0);
        self.buffer.truncate(rest);
        self.at -= self.start;
        self.start = 0;
    }

    /// Gives back the memory of a long frame once nothing of it is left.
    fn give_back(&mut self) {
        if self.start == self.buffer.len() {
            self.buffer.clear();
            self.buffer.shrink_to(KEPT_BUFFER);
            self.start = 0;
            self.at = 0;
        }
    }

    fn rest(&self) -> &[u8] {
        self.buffer.get(self.at..).unwrap_or_default()
    }

    /// Skips white space up to the first byte of something.
    fn skip_space(&mut self) {
        let rest = self.rest();
        let space = rest.iter().position(|byte| !is_space(*byte));
        let first = space.and_then(|space| rest.get(space)).copied();
        self.at += space.unwrap_or(rest.len());
        self.start = self.at;
        match first {
            Some(b'{') => {
                self.state = State::Object;
                self.nesting = Nesting::new();
            }
            Some(_) => self.state = State::Line,
            None => {}
        }
    }

    /// Goes on in a line that is no object. `None` if it has not ended yet or has been reported.
    fn scan_line(&mut self) -> Option<FrameError> {
        let rest = self.rest();
        let newline = rest.iter().position(|&byte| byte == b'\n');
        let length = newline.unwrap_or(rest.len());
        if self.state == State::SkippedLine {
            self.at += length;
            self.start = self.at;
            if newline.is_some() {
                self.state = State::Between;
            }
            return None;
        }
        let wanted = MAX_PREFIX - (self.at - self.start);
        self.at += length.min(wanted);
        if newline.is_none() && length < wanted {
            return None;
        }
        let error = self.not_an_object();
        self.state = State::SkippedLine;
        self.start = self.at;
        Some(error)
    }

    fn not_an_object(&self) -> FrameError {
        let prefix = self.buffer.get(self.start..self.at).unwrap_or_default();
        let cut = prefix.len() == MAX_PREFIX;
        let text = String::from_utf8_lossy(prefix.trim_ascii_end());
        let excerpt = text::excerpt(&text);
        FrameError::NotAnObject(if cut { excerpt + "…" } else { excerpt })
    }

    /// Goes on in an object. `None` if it has not ended yet, or ended after it had been reported.
    fn scan_object(&mut self) -> Option<Result<Frame, FrameError>> {
        let (scanned, event) = self
            .nesting
            .scan(self.buffer.get(self.at..).unwrap_or_default());
        self.at += scanned;
        let kept = self.state == State::Object;
        if !kept {
            self.start = self.at;
        }
        // A newline stays unscanned: it belongs to the white space after the frame and counts for no frame's length.
        let limit = self.limit;
        let too_long = self.at - self.start > limit;
        let (state, error) = match event {
            None if !too_long => return None,
            None => (State::SkippedObject, FrameError::TooLong(limit)),
            Some(Event::Balanced) if kept && !too_long => return Some(self.take_frame()),
            Some(Event::Balanced) => (State::Between, FrameError::TooLong(limit)),
            Some(Event::Newline { in_string: true }) => {
                (State::Between, FrameError::LineEndedInString)
            }
            Some(Event::Newline { in_string: false }) => (State::Between, FrameError::LineEnded),
            Some(Event::Mismatch { opener, found }) => {
                (State::SkippedLine, FrameError::Mismatch { opener, found })
            }
            Some(Event::TooDeep) => (State::SkippedObject, FrameError::TooDeep),
        };
        self.state = state;
        self.start = self.at;
        kept.then_some(Err(if too_long {
            FrameError::TooLong(limit)
        } else {
            error
        }))
    }

    /// The frame that has just balanced.
    fn take_frame(&mut self) -> Result<Frame, FrameError> {
        let bytes = self
            .buffer
            .get(self.start..self.at)
            .unwrap_or_default()
            .to_vec();
        let behind = self
            .rest()
            .iter()
            .find(|byte| !matches!(byte, b' ' | b'\t' | b'\r'));
        let newline = behind == Some(&b'\n');
        self.start = self.at;
        self.state = State::Between;
        let text = String::from_utf8(bytes).map_err(|error| FrameError::NotUtf8 {
            at: error.utf8_error().valid_up_to(),
        })?;
        let text = if self.nesting.names {
            json::accept_literals(text)
        } else {
            text
        };
        Ok(Frame { text, newline })
    }
}

/// Frames as far as the bytes reach: `None` means that more bytes are needed, not that the stream has ended.
impl Iterator for FrameReader {
    type Item = Result<Frame, FrameError>;

    fn next(&mut self) -> Option<Result<Frame, FrameError>> {
        loop {
            let found = match self.state {
                State::Between => {
                    self.skip_space();
                    None
                }
                State::Object | State::SkippedObject => self.scan_object(),
                State::Line | State::SkippedLine => self.scan_line().map(Err),
            };
            if found.is_some() {
                return found;
            }
            if self.at == self.buffer.len() {
                self.give_back();
                return None;
            }
        }
    }
}

const fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n')
}
