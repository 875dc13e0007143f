//! Bytes into frames: an incremental reader that any split of the stream leaves unmoved, and that resynchronises.
//!
//! A frame is one JSON object. It ends where its braces and brackets balance outside strings, or at a newline. Anything else
//! runs to the newline and is one malformed frame.
//!
//! **Invariant:** every byte is looked at once, and no more is kept than one unfinished frame and what was last pushed.

use super::json;
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
    /// Longer than [`MAX_FRAME`].
    #[error("frame longer than {MAX_FRAME} bytes, skipped")]
    TooLong,
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
        Self {
            buffer: Vec::new(),
            start: 0,
            at: 0,
            state: State::Between,
            nesting: Nesting::new(),
        }
    }

    /// Adds bytes from the stream. Take all frames before the next push, so that memory stays bounded.
    pub fn push(&mut self, bytes: &[u8]) {
        self.compact();
        self.buffer.extend_from_slice(bytes);
    }

    /// The end of the stream, after the last frame was taken: an unfinished frame is one malformed frame.
    pub fn finish(&mut self) -> Option<FrameError> {
        let error = match self.state {
            State::Object => Some(FrameError::StreamEnded),
            State::Line => Some(self.not_an_object()),
            State::Between | State::SkippedObject | State::SkippedLine => None,
        };
        *self = Self::new();
        error
    }

    /// Moves what is unfinished to the front of the buffer, at most as often as it has been outgrown by what is done with.
    fn compact(&mut self) {
        let rest = self.buffer.len() - self.start;
        if self.start < rest {
            return;
        }
        self.buffer.copy_within(self.start.., 0);
        self.buffer.truncate(rest);
        self.at -= self.start;
        self.start = 0;
        if rest <= KEPT_BUFFER && self.buffer.capacity() > 2 * KEPT_BUFFER {
            self.buffer.shrink_to(KEPT_BUFFER);
        }
    }

    fn rest(&self) -> &[u8] {
        self.buffer.get(self.at..).unwrap_or_default()
    }

    /// Skips white space; `false` if there is nothing else.
    fn skip_space(&mut self) -> bool {
        let rest = self.rest();
        let space = rest
            .iter()
            .position(|byte| !matches!(byte, b' ' | b'\t' | b'\r' | b'\n'));
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
        first.is_some()
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
        // A newline is left for the white space after the frame, so that it counts for no frame's length.
        let too_long = self.at - self.start > MAX_FRAME;
        let error = match event {
            None if !too_long => return None,
            Some(Event::Balanced) if kept && !too_long => return Some(self.take_frame()),
            None => {
                self.state = State::SkippedObject;
                FrameError::TooLong
            }
            Some(event) => {
                self.state = event.next_state();
                if too_long {
                    FrameError::TooLong
                } else {
                    event.error()
                }
            }
        };
        self.start = self.at;
        kept.then_some(Err(error))
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
                    if !self.skip_space() {
                        return None;
                    }
                    None
                }
                State::Object | State::SkippedObject => self.scan_object(),
                State::Line | State::SkippedLine => self.scan_line().map(Err),
            };
            if found.is_some() {
                return found;
            }
            if self.at == self.buffer.len() {
                return None;
            }
        }
    }
}

/// What a scan of an object came upon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Event {
    Balanced,
    Newline { in_string: bool },
    Mismatch { opener: char, found: char },
    TooDeep,
}

impl Event {
    const fn next_state(self) -> State {
        match self {
            Self::Balanced | Self::Newline { .. } => State::Between,
            Self::Mismatch { .. } => State::SkippedLine,
            Self::TooDeep => State::SkippedObject,
        }
    }

    const fn error(self) -> FrameError {
        match self {
            Self::Newline { in_string: true } => FrameError::LineEndedInString,
            Self::Balanced | Self::Newline { in_string: false } => FrameError::LineEnded,
            Self::Mismatch { opener, found } => FrameError::Mismatch { opener, found },
            Self::TooDeep => FrameError::TooDeep,
        }
    }
}

/// Where in an object the scan is: the brackets that are open, and whether it is inside a string.
#[derive(Debug, Clone, Copy)]
struct Nesting {
    depth: usize,
    /// One bit per open level, the innermost last: 1 for a bracket, 0 for a brace. Holds [`MAX_NESTING`] levels.
    brackets: u128,
    in_string: bool,
    escaped: bool,
    /// Whether an `N` or an `I` stood outside strings: only then can there be a `NaN` or an `Infinity`.
    names: bool,
}

impl Nesting {
    const fn new() -> Self {
        Self {
            depth: 0,
            brackets: 0,
            in_string: false,
            escaped: false,
            names: false,
        }
    }

    /// Goes on with `bytes`: how many were scanned, and what stopped the scan. A newline stops it before, all else behind.
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
                    Some(b'\n') => return (at, Some(Event::Newline { in_string: true })),
                    Some(b'\\') => self.escaped = true,
                    Some(_) => self.in_string = false,
                }
                at += 1;
                continue;
            }
            if byte == b'\n' {
                return (at, Some(Event::Newline { in_string: false }));
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
            b'N' | b'I' => self.names = true,
            _ => {}
        }
        None
    }

    fn open(&mut self, bracket: u128) -> Option<Event> {
        self.depth += 1;
        if self.depth <= MAX_NESTING {
            self.brackets = (self.brackets << 1) | bracket;
        }
        (self.depth == MAX_NESTING + 1).then_some(Event::TooDeep)
    }

    fn close(&mut self, bracket: u128) -> Option<Event> {
        if self.depth <= MAX_NESTING {
            if self.brackets & 1 != bracket {
                let (opener, found) = if bracket == 1 { ('{', ']') } else { ('[', '}') };
                return Some(Event::Mismatch { opener, found });
            }
            self.brackets >>= 1;
        }
        self.depth -= 1;
        (self.depth == 0).then_some(Event::Balanced)
    }
}

/// How many bytes from the start are plain inside a string: neither its end, nor an escape, nor a newline.
fn plain_in_string(bytes: &[u8]) -> usize {
    /// A block that the compiler can compare with a few vector instructions.
    const BLOCK: usize = 32;
    let special = |byte: &u8| matches!(byte, b'"' | b'\\' | b'\n');
    let blocks = bytes
        .chunks_exact(BLOCK)
        .take_while(|block| !block.iter().fold(false, |any, byte| any | special(byte)))
        .count();
    let plain = blocks * BLOCK;
    let rest = bytes.get(plain..).unwrap_or_default();
    plain + rest.iter().position(special).unwrap_or(rest.len())
}

/// What a connection's first bytes say about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Opening {
    /// Could still become anything: wait for more bytes (at most eight are ever needed).
    Undecided,
    /// Ours to read.
    Json,
    /// Another protocol: answer one line, close, parse nothing.
    Foreign(Foreign),
}

/// Protocols that must never be read as JSON: a web page could otherwise drive the arm by posting at the port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Foreign {
    /// An HTTP request line.
    Http,
    /// A TLS hello.
    Tls,
    /// BSON, as some C++ rosbridge clients send.
    Bson,
}

impl Foreign {
    /// One line for the status: what was recognised, and what this port speaks.
    #[must_use]
    pub const fn explanation(self) -> &'static str {
        match self {
            Self::Http => {
                "this is an HTTP request, and this port speaks rosbridge JSON over plain TCP, one object per line"
            }
            Self::Tls => {
                "this is a TLS hello, and this port speaks rosbridge JSON over plain TCP, one object per line"
            }
            Self::Bson => {
                "this is BSON, and this port speaks rosbridge JSON over plain TCP, one object per line"
            }
        }
    }
}

/// How HTTP requests open.
const METHODS: [&[u8]; 10] = [
    b"GET ",
    b"HEAD ",
    b"POST ",
    b"PUT ",
    b"DELETE ",
    b"CONNECT ",
    b"OPTIONS ",
    b"TRACE ",
    b"PATCH ",
    b"PRI ",
];
/// How a TLS record with a hello opens.
const TLS_HELLO: &[u8] = &[0x16, 0x03];
/// A BSON document opens with its length in four bytes, little-endian: below 16 MiB one of them is 0.
const BSON_LENGTH: usize = 4;

/// Judges a connection by all the bytes that it has sent so far.
///
/// At the end of the stream what is undecided is to be read as JSON.
#[must_use]
pub fn opening(first: &[u8]) -> Opening {
    if first.starts_with(TLS_HELLO) {
        return Opening::Foreign(Foreign::Tls);
    }
    if first.iter().take(BSON_LENGTH).any(|&byte| byte == 0) {
        return Opening::Foreign(Foreign::Bson);
    }
    if METHODS.iter().any(|method| first.starts_with(method)) {
        return Opening::Foreign(Foreign::Http);
    }
    let method_may_follow = METHODS.iter().any(|method| method.starts_with(first));
    let nul_may_follow = first.len() < BSON_LENGTH && !holds_a_line(first);
    if method_may_follow || nul_may_follow {
        Opening::Undecided
    } else {
        Opening::Json
    }
}

/// Whether a line with text in it is complete: such a line is answered, not kept waiting for a fourth byte.
fn holds_a_line(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().contains(&b'\n')
}
