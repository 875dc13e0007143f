//! WebSocket frames (RFC 6455) of a client.
//!
//! **Invariant:** this module handles only bytes, and can also write invalid frames.

/// The key of every handshake, and the answer to it (RFC 6455, section 1.3).
const KEY: &str = "dGhlIHNhbXBsZSBub25jZQ==";
pub(crate) const ACCEPT: &str = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";

/// The bit of the last frame of a message.
pub const LAST: u8 = 0x80;

/// Kinds of frames.
pub mod opcode {
    /// Continues a message.
    pub const CONTINUATION: u8 = 0;
    /// Begins a text message.
    pub const TEXT: u8 = 1;
    /// Begins a binary message.
    pub const BINARY: u8 = 2;
    /// Ends the connection.
    pub const CLOSE: u8 = 8;
    /// Asks for a pong.
    pub const PING: u8 = 9;
    /// Answers a ping.
    pub const PONG: u8 = 10;
}

/// The request that opens a WebSocket at `target` of `host`. `headers` are further lines, each with its line end.
#[must_use]
pub fn handshake(host: &str, target: &str, headers: &str) -> String {
    format!(
        "GET {target} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {KEY}\r\n{headers}\r\n"
    )
}

/// Appends a masked frame of a client. `first_byte` is an [`opcode`], with [`LAST`] for the last frame.
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
    let masked = payload.iter().zip(mask.iter().cycle());
    out.extend(masked.map(|(byte, mask)| byte ^ mask));
}

/// Appends a message in fragments of about `piece` bytes with a ping between them; 0 means one frame.
pub fn append_message(out: &mut Vec<u8>, kind: u8, mask: [u8; 4], piece: usize, message: &[u8]) {
    let piece = if piece == 0 {
        message.len().max(1)
    } else {
        piece
    };
    let mut pieces = message.chunks(piece).peekable();
    let mut opcode = kind;
    if message.is_empty() {
        append(out, LAST | opcode, mask, message);
    }
    while let Some(part) = pieces.next() {
        let is_last = pieces.peek().is_none();
        append(out, opcode | if is_last { LAST } else { 0 }, mask, part);
        opcode = opcode::CONTINUATION;
        if !is_last && part.len() % 2 == 1 {
            append(out, LAST | opcode::PING, mask, b"?");
        }
    }
}

/// Appends a close frame with this code and reason.
pub fn append_close(out: &mut Vec<u8>, mask: [u8; 4], code: u16, reason: &str) {
    let payload = [&code.to_be_bytes(), reason.as_bytes()].concat();
    append(out, LAST | opcode::CLOSE, mask, &payload);
}
