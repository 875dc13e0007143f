//! Bytes to messages and back, without I/O: one JSON object per line, or one per WebSocket message.
//!
//! **Invariant:** the reader is strict: a frame that no server may send is an error.

use serde_json::Value;

use crate::Error;
use crate::websocket::{ACCEPT, LAST, append, opcode};

/// How frames are separated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Framing {
    /// One JSON object per line.
    Lines,
    /// One per WebSocket message.
    WebSocket,
}

/// A received message or control frame.
#[derive(Debug, PartialEq, Eq)]
pub enum Event {
    /// A line without its end, or a text message.
    Text(String),
    /// A binary message.
    Binary(Vec<u8>),
    /// A ping, which must be answered with its payload.
    Ping(Vec<u8>),
    /// A pong.
    Pong(Vec<u8>),
    /// The end of a WebSocket: its code, if it has one, and its reason.
    Close(Option<u16>, String),
}

impl Event {
    /// The frame of a text, or `None` for a ping or a pong.
    ///
    /// # Errors
    /// [`Error::Ended`] for a close, and [`Error::Malformed`] if it is no frame.
    pub fn into_frame(self) -> Result<Option<Value>, Error> {
        match self {
            Self::Text(text) => serde_json::from_str(&text)
                .map(Some)
                .map_err(|error| Error::Malformed(format!("{error} in {text:?}"))),
            Self::Ping(_) | Self::Pong(_) => Ok(None),
            Self::Close(..) => Err(Error::Ended),
            Self::Binary(_) => Err(Error::Malformed(format!("{self:?} instead of a frame"))),
        }
    }
}

/// One end of a connection: the received bytes, and the encoder of frames.
#[derive(Debug)]
pub struct Codec {
    framing: Framing,
    bytes: Vec<u8>,
    /// The number of read `bytes`, and the number known to have no line end.
    start: usize,
    scanned: usize,
    is_open: bool,
    is_closed: bool,
    /// The kind of the incomplete message, and its received part.
    unfinished: Option<(u8, Vec<u8>)>,
}

impl Codec {
    /// An end without received bytes. A WebSocket is open once its handshake is answered.
    #[must_use]
    pub fn new(framing: Framing) -> Self {
        Self {
            framing,
            bytes: Vec::new(),
            start: 0,
            scanned: 0,
            is_open: framing == Framing::Lines,
            is_closed: false,
            unfinished: None,
        }
    }

    /// An end after the handshake.
    #[must_use]
    pub fn opened(framing: Framing) -> Self {
        Self {
            is_open: true,
            ..Self::new(framing)
        }
    }

    /// How frames are separated here.
    #[must_use]
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// Whether the handshake is complete.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Whether no received message is incomplete.
    #[must_use]
    pub fn is_between_messages(&self) -> bool {
        self.pending().is_empty() && self.unfinished.is_none()
    }

    /// The received bytes that have not been read.
    #[must_use]
    pub fn pending(&self) -> &[u8] {
        &self.bytes[self.start..]
    }

    /// Discards received bytes that have not been read, and returns their number.
    pub fn discard(&mut self) -> usize {
        let discarded = self.pending().len();
        self.bytes = Vec::new();
        (self.start, self.scanned) = (0, 0);
        discarded
    }

    /// Adds received bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        // Moving the rest to the front costs at most as much as reading the bytes before it.
        if self.start > self.bytes.len() / 2 {
            self.bytes.drain(..self.start);
            self.scanned -= self.start;
            self.start = 0;
        }
        self.bytes.extend_from_slice(bytes);
    }

    /// Appends an encoded frame.
    pub fn write(&self, frame: &str, out: &mut Vec<u8>) {
        match self.framing {
            Framing::Lines => {
                out.extend_from_slice(frame.as_bytes());
                out.push(b'\n');
            }
            Framing::WebSocket => {
                // Any mask is valid. It changes, so that it is not always the same.
                let mask = 0x5bd1_e995_u64.wrapping_mul((out.len() + frame.len()) as u64 | 1);
                let [.., a, b, c, d] = mask.to_be_bytes();
                append(out, LAST | opcode::TEXT, [a, b, c, d], frame.as_bytes());
            }
        }
    }

    /// The next complete message or control frame of the received bytes.
    ///
    /// # Errors
    /// [`Error::Malformed`] for bytes that no server may send.
    pub fn next_event(&mut self) -> Result<Option<Event>, Error> {
        if !self.is_open && !self.read_handshake()? {
            return Ok(None);
        }
        match self.framing {
            Framing::Lines => self.line(),
            Framing::WebSocket => self.message(),
        }
    }

    fn take(&mut self, length: usize) -> &[u8] {
        let from = self.start;
        self.start += length;
        self.scanned = self.scanned.max(self.start);
        &self.bytes[from..self.start]
    }

    fn line(&mut self) -> Result<Option<Event>, Error> {
        let unscanned = &self.bytes[self.scanned..];
        let Some(at) = unscanned.iter().position(|byte| *byte == b'\n') else {
            self.scanned = self.bytes.len();
            return Ok(None);
        };
        let length = self.scanned + at + 1 - self.start;
        let line = self.take(length);
        text(line[..length - 1].to_vec()).map(|text| Some(Event::Text(text)))
    }

    fn read_handshake(&mut self) -> Result<bool, Error> {
        let end = self
            .pending()
            .windows(4)
            .position(|four| four == b"\r\n\r\n");
        let Some(end) = end else { return Ok(false) };
        let head = text(self.take(end + 4).to_vec())?;
        self.is_open = head.starts_with("HTTP/1.1 101 ") && head.contains(ACCEPT);
        check(self.is_open, || {
            format!("the handshake is answered {head:?}")
        })?;
        Ok(true)
    }

    fn message(&mut self) -> Result<Option<Event>, Error> {
        while let Some((first, payload)) = self.frame()? {
            check(!self.is_closed, || {
                "a frame after the close frame".to_owned()
            })?;
            check(first & 0x70 == 0, || {
                "an extension that was not agreed on".to_owned()
            })?;
            let is_last = first & LAST != 0;
            let opcode = first & 0x0f;
            if opcode >= opcode::CLOSE {
                let whole = is_last && payload.len() < 126;
                check(whole, || {
                    "a control frame that is long or in fragments".to_owned()
                })?;
                return self.control(opcode, payload).map(Some);
            }
            let (kind, message) = match (self.unfinished.take(), opcode) {
                (Some((kind, mut message)), opcode::CONTINUATION) => {
                    message.extend_from_slice(&payload);
                    (kind, message)
                }
                (None, opcode::TEXT | opcode::BINARY) => (opcode, payload),
                (_, opcode) => {
                    return Err(Error::Malformed(format!("opcode {opcode} out of place")));
                }
            };
            if !is_last {
                self.unfinished = Some((kind, message));
                continue;
            }
            return match kind {
                opcode::TEXT => text(message).map(|text| Some(Event::Text(text))),
                _ => Ok(Some(Event::Binary(message))),
            };
        }
        Ok(None)
    }

    fn control(&mut self, opcode: u8, payload: Vec<u8>) -> Result<Event, Error> {
        match opcode {
            opcode::PING => Ok(Event::Ping(payload)),
            opcode::PONG => Ok(Event::Pong(payload)),
            opcode::CLOSE => {
                self.is_closed = true;
                match payload.as_slice() {
                    [] => Ok(Event::Close(None, String::new())),
                    [_] => Err(Error::Malformed("half a close code".to_owned())),
                    [high, low, reason @ ..] => {
                        let code = u16::from_be_bytes([*high, *low]);
                        Ok(Event::Close(Some(code), text(reason.to_vec())?))
                    }
                }
            }
            other => Err(Error::Malformed(format!("opcode {other}"))),
        }
    }

    /// The first byte and the payload of the next complete frame.
    fn frame(&mut self) -> Result<Option<(u8, Vec<u8>)>, Error> {
        let &[first, second, ref rest @ ..] = self.pending() else {
            return Ok(None);
        };
        check(second & 0x80 == 0, || {
            "a masked frame of a server".to_owned()
        })?;
        let extended = match second {
            126 => 2,
            127 => 8,
            _ => 0,
        };
        let Some(field) = rest.get(..extended) else {
            return Ok(None);
        };
        let length = match extended {
            0 => usize::from(second),
            _ => field
                .iter()
                .fold(0, |length, byte| (length << 8) | usize::from(*byte)),
        };
        if rest.len() - extended < length {
            return Ok(None);
        }
        self.take(2 + extended);
        Ok(Some((first, self.take(length).to_vec())))
    }
}

fn text(bytes: Vec<u8>) -> Result<String, Error> {
    String::from_utf8(bytes).map_err(|error| Error::Malformed(format!("not UTF-8: {error}")))
}

fn check(holds: bool, what: impl FnOnce() -> String) -> Result<(), Error> {
    if holds {
        Ok(())
    } else {
        Err(Error::Malformed(what()))
    }
}

#[cfg(test)]
mod tests {
    //! All other tests read their frames by it: a valid frame that is read wrongly fails those.

    use super::*;

    #[test]
    fn invalid_server_frames_are_errors() {
        for bytes in [
            &b"\x81\x80\0\0\0\0"[..], // masked
            b"\xc1\x00",              // a reserved bit
            b"\x80\x00",              // goes on with nothing
            b"\x01\x00\x01\x00",      // a message within a message
            b"\x09\x00",              // a ping in fragments
            b"\x83\x00",              // a reserved kind
            b"\x88\x01\x03",          // half a code
            b"\x81\x01\xff",          // not UTF-8
            b"\x88\x00\x81\x00",      // something after the end
        ] {
            let mut codec = Codec::opened(Framing::WebSocket);
            codec.push(bytes);
            let malformed =
                std::iter::from_fn(|| codec.next_event().transpose()).any(|event| event.is_err());
            assert!(malformed, "{bytes:x?}");
        }
    }

    #[test]
    fn a_websocket_does_not_open_with_another_answer() {
        let mut codec = Codec::new(Framing::WebSocket);
        codec.push(b"HTTP/1.1 101 X\r\nSec-WebSocket-Accept: another\r\n\r\n");
        assert!(codec.next_event().is_err());
    }
}
