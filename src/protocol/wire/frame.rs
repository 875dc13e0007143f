//! Splits bytes into frames. The result does not depend on how the stream is divided into chunks.
//!
//! A frame is one JSON object. It ends where its braces and brackets balance outside strings. Anything else is reported
//! and skipped: an object with a fault to its end, or to the newline if its brackets do not match, and a line to the
//! newline. Messages that need no parsing (see [`series`]) are taken unchanged.
//!
//! **Invariant:** no byte is read more than three times. At most one incomplete frame and the last chunk are kept. Each
//! part that is not a frame is reported once: an object at its fault, a line after its first bytes.

pub use super::fault::{FrameError, KEPT_START};
use super::fault::{MAX_PREFIX, Refused, not_an_object, not_utf8, start_of};
use super::literals::accept_literals;
pub use super::opening::{Foreign, Opening, is_host_line, opening};
use super::series::{self, Series};
use crate::protocol::limits::{MAX_FRAME, MAX_NESTING, MEDIUM};

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
    /// A part that is not a frame, with its first bytes, at most [`KEPT_START`]. A line that is not an object has none.
    Error(FrameError, Vec<u8>),
}

/// Takes bytes in chunks and returns frames, one at a time.
///
/// [`push`](Self::push) a chunk, then [`cut`](Self::cut) until it returns `None`. At the end of the
/// stream, call [`finish`](Self::finish).
#[derive(Debug)]
pub struct FrameReader {
    buffer: Vec<u8>,
    /// Start of the present frame in the buffer. Bytes before it have been returned or skipped.
    start: usize,
    /// How far the buffer has been scanned.
    at: usize,
    state: ScanState,
    nesting: Nesting,
    /// Whether the end of the line after the last frame has not come.
    is_single: bool,
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

    /// A reader for frames of at most `limit` bytes.
    #[must_use]
    pub const fn with_limit(limit: usize) -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            at: 0,
            state: ScanState::Between,
            nesting: Nesting::new(),
            is_single: false,
            limit,
        }
    }

    /// Adds bytes from the stream. Take all frames before the next push, so that memory stays bounded.
    pub fn push(&mut self, bytes: &[u8]) {
        self.compact();
        append(&mut self.buffer, bytes);
    }

    /// The series of messages at the present position, if there is one. Call this before the next frame.
    pub fn series(&mut self) -> Option<Series> {
        if self.state != ScanState::Between {
            return None;
        }
        self.skip_space();
        let series = series::leading(self.rest())?;
        self.at += series.frames.len();
        self.start = self.at;
        self.state = ScanState::Between;
        self.is_single = false;
        Some(series)
    }

    /// Cuts off the next part of the stream. `None` means that more bytes are needed, not that the stream has ended.
    pub fn cut(&mut self) -> Option<FramePart> {
        if let Some(lines) = self.series() {
            return Some(FramePart::Lines(lines));
        }
        Some(match self.next_raw()? {
            Ok(frame) => FramePart::Frame(frame),
            Err((error, start)) => FramePart::Error(error, start),
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

    /// Whether no line end has come after the last frame. Older raw-TCP clients send none, and need each frame in a
    /// separate write.
    #[must_use]
    pub const fn is_single(&self) -> bool {
        self.is_single
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

    /// The bytes that have not been scanned.
    fn rest(&self) -> &[u8] {
        self.buffer.get(self.at..).unwrap_or_default()
    }

    /// The scanned bytes of the present frame.
    fn scanned(&self) -> &[u8] {
        self.buffer.get(self.start..self.at).unwrap_or_default()
    }

    /// Skips white space, up to the start of an object or a line.
    fn skip_space(&mut self) {
        let rest = self.rest();
        let is_space = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\r' | b'\n');
        let space = rest.iter().position(|byte| !is_space(byte));
        let space = space.unwrap_or(rest.len());
        // The line end may come in a packet of its own.
        if self.is_single && rest.iter().take(space).any(|byte| *byte == b'\n') {
            self.is_single = false;
        }
        self.at += space;
        self.start = self.at;
        match self.buffer.get(self.at) {
            Some(b'{') => {
                self.state = ScanState::Object;
                self.nesting = Nesting::new();
            }
            Some(_) => self.state = ScanState::Line,
            None => {}
        }
    }

    /// Continues an object. `None` if it has not ended yet.
    fn scan_object(&mut self) -> Option<Result<RawFrame, Refused>> {
        let end = self.scan();
        // A newline stays unscanned. It belongs to the white space after the frame and does not count for a frame's
        // length.
        let is_too_long = self.at - self.start > self.limit;
        match end {
            None if !is_too_long => None,
            Some(Ok(())) if !is_too_long => Some(Ok(self.take_frame())),
            end => Some(Err(self.refuse(end, is_too_long))),
        }
    }

    /// Continues the scan of an object, up to its end or a fault.
    fn scan(&mut self) -> Option<ObjectEnd> {
        let rest = self.buffer.get(self.at..).unwrap_or_default();
        let (scanned, end) = self.nesting.scan(rest);
        self.at += scanned;
        end
    }

    /// The frame that has just ended.
    fn take_frame(&mut self) -> RawFrame {
        let rest = self.rest();
        let is_space = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\r');
        let is_single = rest.iter().find(|byte| !is_space(byte)) != Some(&b'\n');
        let length = self.at - self.start;
        let bytes = if length > KEPT_BUFFER && length >= rest.len() {
            // The frame keeps the buffer. The bytes after it are copied, because they are fewer.
            let rest = self.buffer.split_off(self.at);
            let mut bytes = std::mem::replace(&mut self.buffer, rest);
            bytes.drain(..self.start);
            self.at = 0;
            bytes
        } else {
            self.scanned().to_vec()
        };
        self.start = self.at;
        self.state = ScanState::Between;
        self.is_single = is_single;
        RawFrame {
            bytes,
            has_literals: Some(self.nesting.has_literals),
        }
    }

    /// The next frame, or a part that is not a frame. `None` means that more bytes are needed.
    fn next_raw(&mut self) -> Option<Result<RawFrame, Refused>> {
        loop {
            let found = match self.state {
                ScanState::Between => {
                    self.skip_space();
                    None
                }
                ScanState::Object => self.scan_object(),
                _ => self.scan_malformed().map(Err),
            };
            if found.is_some() {
                return found;
            }
            if self.at == self.buffer.len() {
                if self.start == self.at {
                    // Nothing is left. The memory of a long frame is freed.
                    self.compact();
                    self.buffer.shrink_to(KEPT_BUFFER);
                }
                return None;
            }
        }
    }

    // ---- parts that are not frames ----------------------------------------------------------------------------------

    /// Ends the stream, after the last frame was taken. An incomplete frame is one malformed frame.
    pub fn finish(&mut self) -> Option<FrameError> {
        let error = match self.state {
            ScanState::Object => Some(FrameError::StreamEnded),
            ScanState::Line => Some(not_an_object(self.scanned())),
            _ => None,
        };
        *self = Self::with_limit(self.limit);
        error
    }

    /// Reports an object that has a fault, or is too long.
    fn refuse(&mut self, end: Option<ObjectEnd>, is_too_long: bool) -> Refused {
        let kept = start_of(self.scanned());
        self.state = state_after(end.as_ref());
        self.start = self.at;
        match end {
            Some(Err(error)) if !is_too_long => (error, kept),
            _ => (FrameError::TooLong(self.limit), kept),
        }
    }

    /// Continues a part that is not a frame, or that was reported. `None` if there is nothing to report yet.
    fn scan_malformed(&mut self) -> Option<Refused> {
        if self.state == ScanState::SkippedObject {
            let end = self.scan();
            self.state = state_after(end.as_ref());
            self.start = self.at;
            return None;
        }
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
        let error = not_an_object(self.scanned());
        self.state = ScanState::SkippedLine;
        self.start = self.at;
        Some((error, Vec::new()))
    }
}

/// One JSON object, as text. Its syntax within the outer braces is still unchecked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The text, as [decoded](RawFrame::decode).
    pub text: String,
}

impl Iterator for FrameReader {
    type Item = Result<Frame, FrameError>;

    fn next(&mut self) -> Option<Result<Frame, FrameError>> {
        Some(match self.next_raw()? {
            Ok(frame) => {
                let frame = frame.decode()?.map(|text| Frame { text });
                frame.map_err(|(error, _)| error)
            }
            Err((error, _)) => Err(error),
        })
    }
}

/// The state after the scan of a reported object has stopped.
const fn state_after(end: Option<&ObjectEnd>) -> ScanState {
    match end {
        None | Some(Err(FrameError::TooDeep)) => ScanState::SkippedObject,
        Some(Err(FrameError::Mismatch { .. })) => ScanState::SkippedLine,
        Some(_) => ScanState::Between,
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

// ---- one object -----------------------------------------------------------------------------------------------------

/// One JSON object that has only been scanned for its end, or a message. Another thread may parse it.
#[derive(Debug)]
pub struct RawFrame {
    bytes: Vec<u8>,
    /// Whether it may contain `NaN` or `Infinity`. `None` for a message, which is not scanned yet.
    has_literals: Option<bool>,
}

impl RawFrame {
    /// A message that came over WebSocket or in pieces. It may be pretty-printed.
    #[must_use]
    pub const fn of_message(bytes: Vec<u8>) -> Self {
        Self {
            bytes,
            has_literals: None,
        }
    }

    /// Removes the white space around the message. Returns whether its object may contain `NaN` or `Infinity`; `None`
    /// if there is only white space.
    fn scan_message(&mut self) -> Option<Result<bool, Refused>> {
        self.bytes.truncate(self.bytes.trim_ascii_end().len());
        let space = self.bytes.len() - self.bytes.trim_ascii_start().len();
        self.bytes.drain(..space);
        let scanned = (!self.bytes.is_empty()).then(|| one_object(&self.bytes))?;
        Some(scanned.map_err(|error| (error, start_of(&self.bytes))))
    }

    /// Its length in bytes.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "only a message may be empty")]
    pub const fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The text, with `NaN` and `Infinity` [replaced](accept_literals). `None` for a message that has only white space.
    ///
    /// # Errors
    /// If it is not one object in UTF-8, with its first bytes.
    pub fn decode(mut self) -> Option<Result<String, Refused>> {
        let has_literals = match self.has_literals {
            Some(has_literals) => has_literals,
            None => match self.scan_message()? {
                Ok(has_literals) => has_literals,
                Err(refused) => return Some(Err(refused)),
            },
        };
        let text = String::from_utf8(self.bytes).map_err(|error| not_utf8(&error));
        Some(match text {
            Ok(text) if has_literals => Ok(accept_literals(text)),
            text => text,
        })
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
        let (scanned, end) = nesting.scan(rest);
        rest = rest.get(scanned..).unwrap_or_default();
        match end {
            Some(Ok(())) if rest.is_empty() => return Ok(nesting.has_literals),
            Some(Ok(())) => return Err(FrameError::MoreBehind),
            // The newline, which is unscanned, is white space between tokens.
            Some(Err(FrameError::LineEnded)) => rest = rest.get(1..).unwrap_or_default(),
            Some(Err(error)) => return Err(error),
            None => return Err(FrameError::LineEnded),
        }
    }
}

const _: () = assert!(MAX_NESTING <= u128::BITS as usize, "one bit per level");

/// Why a scan of an object stops: its last brace, or a fault. A newline is such a fault too.
type ObjectEnd = Result<(), FrameError>;

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
    fn scan(&mut self, bytes: &[u8]) -> (usize, Option<ObjectEnd>) {
        let mut at = 0;
        while let Some(&byte) = bytes.get(at) {
            if self.in_string {
                if self.escaped && byte != b'\n' {
                    self.escaped = false;
                    at += 1;
                    continue;
                }
                at += plain_in_string(bytes.get(at..).unwrap_or_default());
                match bytes.get(at) {
                    None => break,
                    Some(b'\n') => return (at, Some(Err(FrameError::LineEndedInString))),
                    Some(b'\\') => self.escaped = true,
                    Some(_) => self.in_string = false,
                }
                at += 1;
                continue;
            }
            if byte == b'\n' {
                return (at, Some(Err(FrameError::LineEnded)));
            }
            at += 1;
            if let Some(end) = self.structural(byte) {
                return (at, Some(end));
            }
        }
        (bytes.len(), None)
    }

    #[inline]
    fn structural(&mut self, byte: u8) -> Option<ObjectEnd> {
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

    fn open(&mut self, bracket: u128) -> Option<ObjectEnd> {
        self.depth += 1;
        if self.depth <= MAX_NESTING {
            self.brackets = (self.brackets << 1) + bracket;
        }
        (self.depth == MAX_NESTING + 1).then_some(Err(FrameError::TooDeep))
    }

    fn close(&mut self, bracket: u128) -> Option<ObjectEnd> {
        if self.depth <= MAX_NESTING {
            if self.brackets & 1 != bracket {
                let (opener, found) = if bracket == 1 { ('{', ']') } else { ('[', '}') };
                return Some(Err(FrameError::Mismatch { opener, found }));
            }
            self.brackets >>= 1;
        }
        self.depth -= 1;
        (self.depth == 0).then_some(Ok(()))
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
