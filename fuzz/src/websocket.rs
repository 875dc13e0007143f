//! WebSocket frames (RFC 6455), written as a client does and read as a strict one does.

/// The request that opens a WebSocket.
pub const HANDSHAKE: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n";

/// What a frame is.
pub mod opcode {
    /// Goes on with a message.
    pub const CONTINUATION: u8 = 0;
    /// Begins a text.
    pub const TEXT: u8 = 1;
    /// Begins bytes.
    pub const BINARY: u8 = 2;
    /// The end.
    pub const CLOSE: u8 = 8;
    /// A question.
    pub const PING: u8 = 9;
    /// Its answer.
    pub const PONG: u8 = 10;
}

/// Appends a frame as a client sends it: masked.
pub fn append(out: &mut Vec<u8>, first_byte: u8, mask: [u8; 4], payload: &[u8]) {
    out.push(first_byte);
    let length = payload.len();
    match (u8::try_from(length), u16::try_from(length)) {
        (Ok(short @ ..126), _) => out.push(0x80 | short),
        (_, Ok(length)) => {
            out.push(0x80 | 126);
            out.extend_from_slice(&length.to_be_bytes());
        }
        _ => {
            out.push(0x80 | 127);
            out.extend_from_slice(&(length as u64).to_be_bytes());
        }
    }
    out.extend_from_slice(&mask);
    let masked = payload
        .iter()
        .zip(mask.iter().cycle())
        .map(|(byte, mask)| byte ^ mask);
    out.extend(masked);
}

/// Appends a message in fragments of about `piece` bytes, with a ping between them; 0: in one frame.
pub fn append_message(out: &mut Vec<u8>, kind: u8, mask: [u8; 4], piece: usize, message: &[u8]) {
    let piece = if piece == 0 {
        message.len().max(1)
    } else {
        piece
    };
    let mut pieces = message.chunks(piece).peekable();
    let mut opcode = kind;
    if message.is_empty() {
        append(out, 0x80 | opcode, mask, message);
    }
    while let Some(part) = pieces.next() {
        let is_last = pieces.peek().is_none();
        append(out, opcode | if is_last { 0x80 } else { 0 }, mask, part);
        opcode = opcode::CONTINUATION;
        if !is_last && part.len() % 2 == 1 {
            append(out, 0x80 | opcode::PING, mask, b"?");
        }
    }
}

/// What a server sends: frames out of bytes. Panics at what no server may send.
#[derive(Debug, Default)]
pub struct Reader {
    bytes: Vec<u8>,
    /// The kind of the message that has begun, and what of it came.
    unfinished: Option<(u8, Vec<u8>)>,
    closed: Option<String>,
}

/// What came.
#[derive(Debug, PartialEq, Eq)]
pub enum Event {
    Text(String),
    Binary(Vec<u8>),
    Ping(Vec<u8>),
    Pong,
    Close,
}

impl Reader {
    /// Adds bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Whether nothing is left over.
    #[must_use]
    pub fn is_between_messages(&self) -> bool {
        self.bytes.is_empty() && self.unfinished.is_none()
    }

    /// Why the server has closed, if it has.
    #[must_use]
    pub fn closed(&self) -> Option<&str> {
        self.closed.as_deref()
    }

    /// The next whole message or control frame.
    pub fn event(&mut self) -> Option<Event> {
        loop {
            let (first, payload) = self.frame()?;
            assert!(self.closed.is_none(), "a frame after the close frame");
            assert_eq!(first & 0x70, 0, "no extension was agreed on");
            let is_last = first & 0x80 != 0;
            let opcode = first & 0x0f;
            if opcode >= opcode::CLOSE {
                assert!(
                    is_last && payload.len() < 126,
                    "control frames are whole and short"
                );
                return Some(self.control(opcode, payload));
            }
            let (kind, message) = match (self.unfinished.take(), opcode) {
                (Some((kind, mut message)), opcode::CONTINUATION) => {
                    message.extend_from_slice(&payload);
                    (kind, message)
                }
                (None, opcode::TEXT | opcode::BINARY) => (opcode, payload),
                (unfinished, opcode) => panic!("opcode {opcode} after {unfinished:?}"),
            };
            if !is_last {
                self.unfinished = Some((kind, message));
                continue;
            }
            return Some(match kind {
                opcode::TEXT => Event::Text(String::from_utf8(message).expect("a text is UTF-8")),
                _ => Event::Binary(message),
            });
        }
    }

    fn control(&mut self, opcode: u8, payload: Vec<u8>) -> Event {
        match opcode {
            opcode::PING => Event::Ping(payload),
            opcode::PONG => Event::Pong,
            opcode::CLOSE => {
                assert_ne!(payload.len(), 1, "a code has two bytes");
                let reason = payload.get(2..).unwrap_or_default();
                assert!(std::str::from_utf8(reason).is_ok(), "a reason is UTF-8");
                self.closed = Some(String::from_utf8_lossy(reason).into_owned());
                Event::Close
            }
            other => panic!("opcode {other}"),
        }
    }

    fn frame(&mut self) -> Option<(u8, Vec<u8>)> {
        let &[first, length, ..] = self.bytes.as_slice() else {
            return None;
        };
        assert_eq!(length & 0x80, 0, "a server does not mask");
        let (start, length) = match length {
            126 => (
                4,
                u64::from(u16::from_be_bytes(self.bytes.get(2..4)?.try_into().ok()?)),
            ),
            127 => (
                10,
                u64::from_be_bytes(self.bytes.get(2..10)?.try_into().ok()?),
            ),
            short => (2, u64::from(short)),
        };
        let end = start + usize::try_from(length).ok()?;
        let payload = self.bytes.get(start..end)?.to_vec();
        self.bytes.drain(..end);
        Some((first, payload))
    }
}
