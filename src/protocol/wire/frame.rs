//! Splits bytes into frames: an incremental reader that resynchronises after a fault. The result does not depend
//! on how the stream is divided into chunks.
//!
//! A frame is one JSON object. It ends where its braces and brackets balance outside strings, or at a newline. Anything
//! else runs to the newline and is one malformed frame.
//!
//! Messages that need no parsing (see [`series`]) are taken unchanged.
//!
//! **Invariant:** no byte is read more than three times. At most one incomplete frame and the last chunk are kept.

use bytes::Bytes;

pub use super::fault::{FrameError, KEPT_START};
use super::fault::{MAX_PREFIX, not_an_object, start_of};
use super::json;
pub use super::opening::{Foreign, Opening, is_host_line, opening};
use super::series::{self, Series};
use crate::protocol::limits::{MAX_FRAME, MAX_NESTING, MEDIUM, SHORT};

/// Buffer that an idle reader may keep.
const KEPT_BUFFER: usize = 16 * 1024;

/// The part of the stream that the reader is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ScanState {
    /// Between frames: white space.
    Between,
    /// In an object that is kept.
    Object,
    /// In an object that has been reported already, and is skipped to its end.
    SkippedObject,
    /// In a line that is not an object. Its beginning is being collected.
    Line,
    /// In a line that has been reported already, and is skipped to the newline.
    SkippedLine,
}

/// The next part of a stream.
#[derive(Debug)]
pub enum FramePart {
    /// Messages of a client on a topic of clients that can be forwarded unchanged.
    Lines(Series),
    /// Any other frame, or a whole WebSocket message.
    Frame(RawFrame),
    /// A part that is not a frame, with its first bytes, at most [`KEPT_START`].
    Error(FrameError, Vec<u8>),
}

/// Takes bytes in chunks and returns frames, one at a time.
///
/// [`push`](Self::push) a chunk, then [`cut`](Self::cut) until it returns `None`. At the end of the
/// stream, call [`finish`](Self::finish). As an iterator it also decodes each frame, without series.
#[derive(Debug)]
pub struct FrameReader {
    buffer: Vec<u8>,
    /// Start of the present frame in the buffer. Bytes before it have been returned or skipped.
    start: usize,
    /// How far the buffer has been scanned.
    at: usize,
    state: ScanState,
    nesting: Nesting,
    /// Longest frame.
    limit: usize,
    /// The first bytes of the last refused object. A line that is not an object has none.
    refused: Vec<u8>,
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

    /// A reader for frames of at most `limit` bytes.
    #[must_use]
    pub const fn with_limit(limit: usize) -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            at: 0,
            state: ScanState::Between,
            nesting: Nesting::new(),
            limit,
            refused: Vec::new(),
        }
    }

    /// Adds bytes from the stream. Take all frames before the next push, so that memory stays bounded.
    pub fn push(&mut self, bytes: &[u8]) {
        self.compact();
        append(&mut self.buffer, bytes);
    }

    /// The series of messages at the present position, if there is one, limited in length. Call this before the next
    /// frame.
    pub fn series(&mut self) -> Option<Series> {
        if self.state != ScanState::Between {
            return None;
        }
        let rest = self.rest();
        let space = rest.iter().position(|byte| !is_space(*byte))?;
        let rest = rest.get(space..)?;
        let rest = rest.get(..SHORT).unwrap_or(rest);
        let (topic, length) = series::leading(rest)?;
        let series = Series {
            topic: topic.into(),
            // The series is a copy, so it does not keep the stream's buffer in memory.
            frames: Bytes::copy_from_slice(rest.get(..length)?),
        };
        self.at += space + length;
        self.start = self.at;
        Some(series)
    }

    /// Cuts off the next part of the stream. `None` means that more bytes are needed, not that the stream has ended.
    pub fn cut(&mut self) -> Option<FramePart> {
        if let Some(lines) = self.series() {
            return Some(FramePart::Lines(lines));
        }
        Some(match self.next_raw()? {
            Ok(frame) => FramePart::Frame(frame),
            Err(error) => FramePart::Error(error, std::mem::take(&mut self.refused)),
        })
    }

    /// The reader's memory in bytes.
    #[must_use]
    pub const fn buffered(&self) -> usize {
        self.buffer.capacity()
    }

    /// Whether a frame has begun and not ended. A skipped frame does not count, because none of it is kept.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        matches!(self.state, ScanState::Object | ScanState::Line)
    }

    /// Ends the stream, after the last frame was taken. An incomplete frame is one malformed frame.
    pub fn finish(&mut self) -> Option<FrameError> {
        let error = match self.state {
            ScanState::Object => Some(FrameError::StreamEnded),
            ScanState::Line => Some(self.line_error()),
            ScanState::Between | ScanState::SkippedObject | ScanState::SkippedLine => None,
        };
        *self = Self::with_limit(self.limit);
        error
    }

    /// Moves the incomplete frame to the front of the buffer once the finished part is longer: constant time per byte.
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

    /// Frees the memory of a long frame once it has been returned.
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

    /// Skips white space.
    fn skip_space(&mut self) {
        let rest = self.rest();
        let space = rest.iter().position(|byte| !is_space(*byte));
        let first = space.and_then(|space| rest.get(space)).copied();
        self.at += space.unwrap_or(rest.len());
        self.start = self.at;
        match first {
            Some(b'{') => {
                self.state = ScanState::Object;
                self.nesting = Nesting::new();
            }
            Some(_) => self.state = ScanState::Line,
            None => {}
        }
    }

    /// Continues a line that is not an object. `None` if it has not ended yet or has been reported.
    fn scan_line(&mut self) -> Option<FrameError> {
        let rest = self.rest();
        let newline = rest.iter().position(|&byte| byte == b'\n');
        let length = newline.unwrap_or(rest.len());
        if self.state == ScanState::SkippedLine {
            self.at += length;
            self.start = self.at;
            if newline.is_some() {
                self.state = ScanState::Between;
            }
            return None;
        }
        let wanted = MAX_PREFIX - (self.at - self.start);
        self.at += length.min(wanted);
        if newline.is_none() && length < wanted {
            return None;
        }
        let error = self.line_error();
        self.state = ScanState::SkippedLine;
        self.start = self.at;
        Some(error)
    }

    fn line_error(&self) -> FrameError {
        not_an_object(self.buffer.get(self.start..self.at).unwrap_or_default())
    }

    /// Continues an object. `None` if it has not ended yet, or was reported before its end.
    fn scan_object(&mut self) -> Option<Result<RawFrame, FrameError>> {
        let (scanned, event) = self
            .nesting
            .scan(self.buffer.get(self.at..).unwrap_or_default());
        self.at += scanned;
        let kept = self.state == ScanState::Object;
        if !kept {
            self.start = self.at;
        }
        // A newline stays unscanned. It belongs to the white space after the frame and does not count for a frame's
        // length.
        let too_long = self.at - self.start > self.limit;
        let state = match &event {
            None if !too_long => return None,
            Some(Event::Balanced) if kept && !too_long => return Some(Ok(self.take_frame())),
            None | Some(Event::Fault(FrameError::TooDeep)) => ScanState::SkippedObject,
            Some(Event::Fault(FrameError::Mismatch { .. })) => ScanState::SkippedLine,
            Some(_) => ScanState::Between,
        };
        let error = match event {
            Some(Event::Fault(error)) if !too_long => error,
            _ => FrameError::TooLong(self.limit),
        };
        if kept {
            self.refused = start_of(self.buffer.get(self.start..self.at).unwrap_or_default());
        }
        self.state = state;
        self.start = self.at;
        kept.then_some(Err(error))
    }

    /// The frame that has just ended.
    fn take_frame(&mut self) -> RawFrame {
        let rest = self.rest();
        let behind = rest
            .iter()
            .find(|byte| !matches!(byte, b' ' | b'\t' | b'\r'));
        let newline = behind == Some(&b'\n');
        let length = self.at - self.start;
        let bytes = if length > KEPT_BUFFER && length >= rest.len() {
            // The frame keeps the buffer. The bytes after it are copied, because they are fewer.
            let mut kept = Vec::with_capacity(rest.len().max(KEPT_BUFFER));
            kept.extend_from_slice(rest);
            let mut bytes = std::mem::replace(&mut self.buffer, kept);
            bytes.truncate(self.at);
            bytes.drain(..self.start);
            self.at = 0;
            bytes
        } else {
            let frame = self.buffer.get(self.start..self.at);
            frame.unwrap_or_default().to_vec()
        };
        self.start = self.at;
        self.state = ScanState::Between;
        RawFrame {
            bytes,
            has_literals: Some(self.nesting.has_literals),
            newline,
        }
    }

    /// The next frame, still to be [decoded](RawFrame::decode). `None` means that more bytes are needed, not that the
    /// stream has ended.
    pub fn next_raw(&mut self) -> Option<Result<RawFrame, FrameError>> {
        loop {
            let found = match self.state {
                ScanState::Between => {
                    self.skip_space();
                    None
                }
                ScanState::Object | ScanState::SkippedObject => self.scan_object(),
                ScanState::Line | ScanState::SkippedLine => self.scan_line().map(Err),
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

/// Iterates over the complete frames, decoded.
impl Iterator for FrameReader {
    type Item = Result<Frame, FrameError>;

    fn next(&mut self) -> Option<Result<Frame, FrameError>> {
        match self.next_raw()? {
            Ok(frame) => Some(frame.decode()?.map_err(|(error, _)| error)),
            Err(error) => Some(Err(error)),
        }
    }
}

/// Appends received bytes. The buffer grows to twice its size, as a `Vec` does, but without a permit it stays within
/// [`MEDIUM`].
pub(super) fn append(buffer: &mut Vec<u8>, bytes: &[u8]) {
    let needed = buffer.len() + bytes.len();
    if needed > buffer.capacity() && needed <= MEDIUM {
        let capacity = (2 * buffer.capacity()).clamp(needed, MEDIUM);
        buffer.reserve_exact(capacity - buffer.len());
    }
    buffer.extend_from_slice(bytes);
}

const fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n')
}

// ---- one object -----------------------------------------------------------------------------------------------------

/// One JSON object, as text. Its syntax within the outer braces is still unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The text, with `NaN` and its like made [acceptable](json::accept_literals).
    pub text: String,
    /// Whether a line end was right after it. Older raw-TCP clients send none, and need each frame in a separate write.
    pub newline: bool,
}

/// A [`Frame`] that has only been scanned for its end, or a message. Another thread may parse it.
#[derive(Debug)]
pub struct RawFrame {
    bytes: Vec<u8>,
    /// Whether it may contain `NaN` or `Infinity`. `None` for a message, which is not scanned yet.
    has_literals: Option<bool>,
    newline: bool,
}

impl RawFrame {
    /// A message of a WebSocket, which may be pretty-printed.
    #[must_use]
    pub const fn of_message(bytes: Vec<u8>) -> Self {
        Self {
            bytes,
            has_literals: None,
            newline: true,
        }
    }

    /// Its length in bytes.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "only a message may be empty")]
    pub const fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether a line end was right after it.
    #[must_use]
    pub const fn newline(&self) -> bool {
        self.newline
    }

    /// The frame. `None` for a message that has only white space.
    ///
    /// # Errors
    /// If it is not one object in UTF-8, with its first bytes.
    pub fn decode(mut self) -> Option<Result<Frame, (FrameError, Vec<u8>)>> {
        let has_literals = match self.has_literals {
            Some(has_literals) => has_literals,
            None => {
                self.bytes.truncate(self.bytes.trim_ascii_end().len());
                let space = self.bytes.len() - self.bytes.trim_ascii_start().len();
                self.bytes.drain(..space);
                if self.bytes.is_empty() {
                    return None;
                }
                match one_object(&self.bytes) {
                    Ok(has_literals) => has_literals,
                    Err(error) => return Some(Err((error, start_of(&self.bytes)))),
                }
            }
        };
        let newline = self.newline;
        let frame = match String::from_utf8(self.bytes) {
            Ok(text) if has_literals => Ok(json::accept_literals(text)),
            Ok(text) => Ok(text),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                Err((FrameError::NotUtf8 { at }, start_of(error.as_bytes())))
            }
        };
        Some(frame.map(|text| Frame { text, newline }))
    }
}

/// Whether the object in `text`, if there is one, may contain `NaN` or `Infinity`.
fn one_object(text: &[u8]) -> Result<bool, FrameError> {
    if !text.starts_with(b"{") {
        let line = text.split(|byte| *byte == b'\n').next();
        return Err(not_an_object(line.unwrap_or_default()));
    }
    let mut nesting = Nesting::new();
    let mut rest = text;
    loop {
        let (scanned, event) = nesting.scan(rest);
        rest = rest.get(scanned..).unwrap_or_default();
        match event {
            Some(Event::Balanced) if rest.is_empty() => return Ok(nesting.has_literals),
            Some(Event::Balanced) => return Err(FrameError::MoreBehind),
            // The newline, which is unscanned, is white space between tokens.
            Some(Event::Fault(FrameError::LineEnded)) => {
                rest = rest.get(1..).unwrap_or_default();
            }
            Some(Event::Fault(error)) => return Err(error),
            None => return Err(FrameError::LineEnded),
        }
    }
}

const _: () = assert!(MAX_NESTING <= u128::BITS as usize, "one bit per level");

/// Why a scan of an object stops.
#[derive(Debug)]
enum Event {
    /// The object has ended.
    Balanced,
    /// It is not a valid object. A newline is such a fault too.
    Fault(FrameError),
}

/// State of the scan in an object: the open brackets, and whether it is inside a string.
#[derive(Debug, Clone, Copy)]
struct Nesting {
    depth: usize,
    /// One bit per open level, the innermost last: 1 for a bracket, 0 for a brace. Holds [`MAX_NESTING`] levels.
    brackets: u128,
    in_string: bool,
    escaped: bool,
    /// Whether there was an `N` or an `I` outside strings. Only then can there be a `NaN` or an `Infinity`.
    has_literals: bool,
}

impl Nesting {
    const fn new() -> Self {
        Self {
            depth: 0,
            brackets: 0,
            in_string: false,
            escaped: false,
            has_literals: false,
        }
    }

    /// Continues with `bytes`. Returns the number of scanned bytes and the reason for the stop. The scan stops before
    /// a newline, and after any other fault or end.
    fn scan(&mut self, bytes: &[u8]) -> (usize, Option<Event>) {
        let mut at = 0;
        while let Some(&byte) = bytes.get(at) {
            if self.in_string {
                if self.escaped {
                    self.escaped = false;
                    if byte != b'\n' {
                        at += 1;
                        continue;
                    }
                }
                at += plain_in_string(bytes.get(at..).unwrap_or_default());
                match bytes.get(at) {
                    None => break,
                    Some(b'\n') => return (at, Some(Event::Fault(FrameError::LineEndedInString))),
                    Some(b'\\') => self.escaped = true,
                    Some(_) => self.in_string = false,
                }
                at += 1;
                continue;
            }
            if byte == b'\n' {
                return (at, Some(Event::Fault(FrameError::LineEnded)));
            }
            at += 1;
            if let Some(event) = self.structural(byte) {
                return (at, Some(event));
            }
        }
        (bytes.len(), None)
    }

    #[inline]
    fn structural(&mut self, byte: u8) -> Option<Event> {
        match byte {
            b'"' => self.in_string = true,
            b'{' => return self.open(0),
            b'[' => return self.open(1),
            b'}' => return self.close(0),
            b']' => return self.close(1),
            b'N' | b'I' => self.has_literals = true,
            _ => {}
        }
        None
    }

    fn open(&mut self, bracket: u128) -> Option<Event> {
        self.depth += 1;
        if self.depth <= MAX_NESTING {
            self.brackets = (self.brackets << 1) + bracket;
        }
        (self.depth == MAX_NESTING + 1).then_some(Event::Fault(FrameError::TooDeep))
    }

    fn close(&mut self, bracket: u128) -> Option<Event> {
        if self.depth <= MAX_NESTING {
            if self.brackets & 1 != bracket {
                let (opener, found) = if bracket == 1 { ('{', ']') } else { ('[', '}') };
                return Some(Event::Fault(FrameError::Mismatch { opener, found }));
            }
            self.brackets >>= 1;
        }
        self.depth -= 1;
        (self.depth == 0).then_some(Event::Balanced)
    }
}

/// The number of bytes from the start that are plain inside a string: no end, no escape and no newline.
fn plain_in_string(bytes: &[u8]) -> usize {
    /// Most strings are keys and names, which are too short for blocks.
    const SHORT: usize = 16;
    /// Bytes that the compiler compares with a few vector instructions.
    const BLOCK: usize = 32;
    let special = |byte: &u8| matches!(byte, b'"' | b'\\' | b'\n');
    if let Some(end) = bytes.iter().take(SHORT).position(special) {
        return end;
    }
    let blocks = bytes
        .chunks_exact(BLOCK)
        .take_while(|block| !block.iter().fold(false, |any, byte| any | special(byte)))
        .count();
    let plain = blocks * BLOCK;
    let rest = bytes.get(plain..).unwrap_or_default();
    plain + rest.iter().position(special).unwrap_or(rest.len())
}
