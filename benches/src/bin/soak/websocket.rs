//! Just enough of the WebSocket protocol for a client, written by hand: what the program says is not read by the library
//! that it was written with, and frames can be broken on purpose.
//!
//! **Invariant:** knows bytes only.

use bytes::{Buf, BytesMut};

/// What a handshake asks with, and what must come back for it (the pair of RFC 6455, section 1.3).
const KEY: &str = "dGhlIHNhbXBsZSBub25jZQ==";
const ACCEPT: &str = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";

/// Kinds of frames: more of the same message.
pub const MORE: u8 = 0;
/// A whole text, or its beginning.
pub const TEXT: u8 = 1;
/// The same, for bytes.
pub const BINARY: u8 = 2;
/// The end.
pub const CLOSE: u8 = 8;
/// Are you there?
pub const PING: u8 = 9;
/// I am.
pub const PONG: u8 = 10;

/// The request that opens a WebSocket at `host`.
pub fn handshake(host: &str) -> String {
    format!(
        "GET / HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {KEY}\r\n\r\n"
    )
}

/// Takes the answer to a handshake off `bytes` once it is whole; whether it is the right one.
pub fn take_answer(bytes: &mut BytesMut) -> Option<bool> {
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n")? + 4;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    bytes.advance(end);
    Some(head.starts_with("HTTP/1.1 101 ") && head.contains(ACCEPT))
}

/// Appends a masked frame.
pub fn push_frame(out: &mut Vec<u8>, kind: u8, last: bool, payload: &[u8], mask: u32) {
    out.push(kind | if last { 0x80 } else { 0 });
    match payload.len() {
        length @ 0..=125 => out.push(0x80 | length as u8),
        length @ 126..=0xffff => {
            out.push(0x80 | 126);
            out.extend((length as u16).to_be_bytes());
        }
        length => {
            out.push(0x80 | 127);
            out.extend((length as u64).to_be_bytes());
        }
    }
    let mask = mask.to_be_bytes();
    out.extend(mask);
    out.extend(
        payload
            .iter()
            .enumerate()
            .map(|(at, byte)| byte ^ mask[at % 4]),
    );
}

/// A frame: its kind, whether it is the last of its message, its content.
pub struct Frame {
    /// What it is.
    pub kind: u8,
    /// No more follow.
    pub last: bool,
    /// What is in it.
    pub content: BytesMut,
}

/// Takes a whole frame off `bytes`. What the program sends is not masked.
pub fn take_frame(bytes: &mut BytesMut) -> Result<Option<Frame>, String> {
    let &[first, second, ..] = &bytes[..] else {
        return Ok(None);
    };
    if first & 0x70 != 0 || second & 0x80 != 0 {
        return Err(format!("a frame that opens with {first:#x} {second:#x}"));
    }
    let extended = match second {
        126 => 2,
        127 => 8,
        _ => 0,
    };
    let Some(field) = bytes.get(2..2 + extended) else {
        return Ok(None);
    };
    let length = match second {
        126 | 127 => field
            .iter()
            .fold(0, |length, byte| (length << 8) | usize::from(*byte)),
        short => usize::from(short),
    };
    if bytes.len() < 2 + extended + length {
        return Ok(None);
    }
    bytes.advance(2 + extended);
    let content = bytes.split_to(length);
    Ok(Some(Frame {
        kind: first & 0xf,
        last: first & 0x80 != 0,
        content,
    }))
}
