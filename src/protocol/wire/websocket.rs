//! Frames of a WebSocket (RFC 6455, section 5): bytes into messages, and back. The result of reading does not depend on
//! how the stream is divided into chunks.
//!
//! A message longer than the limit becomes one error, and the rest of it is skipped. Only the latest ping is answered,
//! as section 5.5.3 allows. A close frame is answered with the same code.
//!
//! **Invariant:** at most one incomplete message, the last chunk and the messages read ahead are kept. The output has
//! at most one part of the messages, one pong and one close frame.

use std::collections::VecDeque;

use bytes::{Buf, BufMut, Bytes, BytesMut};

use super::fault::start_of;
use super::frame::{FrameError, FramePart, RawFrame, append};
use crate::protocol::limits::MAX_FRAME;

/// The kinds of frames.
pub mod opcode {
    /// The next part of a message.
    pub const CONTINUATION: u8 = 0;
    /// A text, or its first part.
    pub const TEXT: u8 = 1;
    /// A binary message, or its first part.
    pub const BINARY: u8 = 2;
    /// The peer sends nothing more.
    pub const CLOSE: u8 = 8;
    /// The peer must answer it.
    pub const PING: u8 = 9;
    /// The answer.
    pub const PONG: u8 = 10;
}

/// The bits of the first byte: the last frame of a message, and those of extensions.
const LAST: u8 = 0x80;
const RESERVED: u8 = 0x70;
/// The bit of the second byte: a mask follows.
const MASKED: u8 = 0x80;
/// Longest payload of a control frame.
const MAX_CONTROL: usize = 125;
/// Bytes of messages in one part of the output. A longer message is sent in fragments, so that the client's progress is
/// measurable.
const FRAGMENT: usize = 32 * 1024;

/// Codes of close frames.
const GOING_AWAY: u16 = 1001;
const PROTOCOL_ERROR: u16 = 1002;
const POLICY_VIOLATION: u16 = 1008;

// ---- input ----------------------------------------------------------------------------------------------------------

/// Why no more messages follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SocketEnd {
    /// The peer has closed, with this code.
    Closed(Option<u16>),
    /// The peer has violated the protocol.
    Violated,
}

/// A data frame whose payload is being received.
#[derive(Debug)]
struct OpenFrame {
    /// Bytes that are still to come.
    left: u64,
    /// The mask of the next bytes.
    mask: [u8; 4],
    /// Whether the message ends with it.
    is_last: bool,
}

/// Takes bytes in chunks and returns messages, one at a time.
///
/// [`push`](Self::push) a chunk, then [`cut`](Self::cut) until it returns `None`.
#[derive(Debug, Default)]
pub struct MessageReader {
    /// Received bytes that are not read yet.
    input: BytesMut,
    frame: Option<OpenFrame>,
    /// Whether a message has begun and not ended.
    is_open: bool,
    /// Whether that message was too long, so the rest of it is skipped.
    is_skipped: bool,
    /// The payload of that message.
    message: Vec<u8>,
    /// Parts that were read ahead.
    ahead: VecDeque<FramePart>,
    ping: Option<Bytes>,
    end: Option<SocketEnd>,
}

impl MessageReader {
    /// Adds bytes from the stream. Take all messages before the next push, so that memory stays bounded.
    pub fn push(&mut self, bytes: &[u8]) {
        self.input.extend_from_slice(bytes);
    }

    /// The next message, or the error for one that is too long. `None` means that more bytes are needed, or that the
    /// stream has an [`end`](Self::end).
    pub fn cut(&mut self) -> Option<FramePart> {
        self.ahead.pop_front().or_else(|| self.read())
    }

    /// Reads pings and an end that come before the next `count` messages are complete. The messages are kept.
    pub fn look_ahead(&mut self, count: usize) {
        while self.ahead.len() < count
            && let Some(part) = self.read()
        {
            self.ahead.push_back(part);
        }
    }

    /// The payload of the latest ping that is not answered yet.
    pub fn take_ping(&mut self) -> Option<Bytes> {
        self.ping.take()
    }

    /// Why no more messages follow.
    #[must_use]
    pub const fn end(&self) -> Option<SocketEnd> {
        self.end
    }

    /// The memory of the incomplete message in bytes.
    #[must_use]
    pub const fn buffered(&self) -> usize {
        self.message.capacity()
    }

    /// Bytes that were received and not returned.
    #[must_use]
    pub fn waiting(&self) -> usize {
        let ahead = self.ahead.iter().map(|part| match part {
            FramePart::Frame(message) => message.len(),
            _ => 0,
        });
        self.input.len() + self.message.len() + ahead.sum::<usize>()
    }

    /// Whether a message has begun and not ended. A skipped message does not count, because none of it is kept.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        !self.is_skipped && (self.is_open || !self.input.is_empty())
    }

    /// Reads up to the end of a message.
    fn read(&mut self) -> Option<FramePart> {
        while self.end.is_none() {
            let Some(mut frame) = self.frame.take() else {
                if self.read_head() {
                    continue;
                }
                return None;
            };
            let count = usize::try_from(frame.left).unwrap_or(usize::MAX);
            let mut payload = self.input.split_to(count.min(self.input.len()));
            unmask(&mut payload, &mut frame.mask);
            frame.left -= payload.len() as u64;
            let is_complete = frame.left == 0;
            let is_last = is_complete && frame.is_last;
            if !is_complete {
                self.frame = Some(frame);
            }
            let error = self.keep(&payload);
            if is_last {
                self.is_open = false;
                let message = std::mem::take(&mut self.message);
                if !std::mem::take(&mut self.is_skipped) {
                    return Some(FramePart::Frame(RawFrame::of_message(message)));
                }
            }
            if error.is_some() || !is_complete {
                return error;
            }
        }
        None
    }

    /// Adds bytes to the message, unless it is skipped. Returns the error if it is too long now.
    fn keep(&mut self, payload: &[u8]) -> Option<FramePart> {
        if self.is_skipped {
            return None;
        }
        append(&mut self.message, payload);
        if self.message.len() <= MAX_FRAME {
            return None;
        }
        self.is_skipped = true;
        let start = start_of(&std::mem::take(&mut self.message));
        Some(FramePart::Error(FrameError::TooLong(MAX_FRAME), start))
    }

    /// Reads the head of a frame, and a whole control frame. Returns whether there was one.
    fn read_head(&mut self) -> bool {
        let Some([first, second]) = self.input.first_chunk().copied() else {
            return false;
        };
        let opcode = first & 0x0f;
        let is_last = first & LAST != 0;
        if first & RESERVED != 0 || second & MASKED == 0 || !is_known(opcode) {
            return self.violated();
        }
        let Some((length, mut mask, size)) = length_and_mask(&self.input) else {
            return false;
        };
        // The first bit of a length is zero.
        if length.leading_zeros() == 0 {
            return self.violated();
        }
        if opcode < opcode::CLOSE {
            if (opcode == opcode::CONTINUATION) != self.is_open {
                return self.violated();
            }
            self.input.advance(size);
            self.is_open = true;
            self.frame = Some(OpenFrame {
                left: length,
                mask,
                is_last,
            });
            return true;
        }
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        if !is_last || length > MAX_CONTROL {
            return self.violated();
        }
        if self.input.len() < size + length {
            return false;
        }
        self.input.advance(size);
        let mut payload = self.input.split_to(length);
        unmask(&mut payload, &mut mask);
        match opcode {
            opcode::PING => self.ping = Some(Bytes::copy_from_slice(&payload)),
            opcode::CLOSE => self.end = Some(closed(&payload)),
            _ => {}
        }
        true
    }

    fn violated(&mut self) -> bool {
        self.end = Some(SocketEnd::Violated);
        false
    }
}

const fn is_known(opcode: u8) -> bool {
    use opcode::*;
    matches!(opcode, CONTINUATION | TEXT | BINARY | CLOSE | PING | PONG)
}

/// The length of the payload, the mask, and the size of the head, if the head is complete.
fn length_and_mask(input: &[u8]) -> Option<(u64, [u8; 4], usize)> {
    let length = input.get(2..)?;
    let (length, mask) = match input.get(1)? & !MASKED {
        126 => (u16::from_be_bytes(*length.first_chunk()?).into(), 4),
        127 => (u64::from_be_bytes(*length.first_chunk()?), 10),
        short => (short.into(), 2),
    };
    Some((length, *input.get(mask..)?.first_chunk()?, mask + 4))
}

/// The end by a close frame: a code that may be sent and a text, or nothing.
fn closed(payload: &[u8]) -> SocketEnd {
    let Some((code, why)) = payload.split_first_chunk() else {
        return match payload {
            [] => SocketEnd::Closed(None),
            _ => SocketEnd::Violated,
        };
    };
    let code = u16::from_be_bytes(*code);
    let may_be_sent = matches!(code, 1000..=1003 | 1007..=1014 | 3000..=4999);
    if may_be_sent && std::str::from_utf8(why).is_ok() {
        SocketEnd::Closed(Some(code))
    } else {
        SocketEnd::Violated
    }
}

/// Removes the mask from the next bytes of a payload.
fn unmask(payload: &mut [u8], mask: &mut [u8; 4]) {
    let (words, rest) = payload.as_chunks_mut();
    for word in words {
        *word = (u32::from_ne_bytes(*word) ^ u32::from_ne_bytes(*mask)).to_ne_bytes();
    }
    for (byte, key) in rest.iter_mut().zip(*mask) {
        *byte ^= key;
    }
    let used = rest.len();
    mask.rotate_left(used);
}

// ---- output ---------------------------------------------------------------------------------------------------------

/// Makes frames of messages, pongs and the close frame.
///
/// [`put`](Self::put) messages, write the [`output`](Self::output), and report each write to [`sent`](Self::sent).
#[derive(Debug, Default)]
pub struct MessageWriter {
    /// Bytes that are to be sent.
    output: BytesMut,
    /// The kind of the message that the next output continues, if there is one.
    unfinished: Option<u8>,
    /// Bytes of messages in `output`, as they were put.
    unsent: usize,
    /// The code and the reason in the close frame. By default it says that the server shuts down.
    close_reason: Option<(Option<u16>, &'static str)>,
    /// The close frame has been put.
    is_closing: bool,
}

impl MessageWriter {
    /// The bytes that are to be sent next.
    #[must_use]
    pub const fn output(&self) -> &BytesMut {
        &self.output
    }

    /// Whether the output has a part of the messages.
    #[must_use]
    pub const fn has_messages(&self) -> bool {
        self.unsent > 0
    }

    /// Notes that `bytes` of the output were sent. At the end of the output, returns the bytes of messages in it.
    /// Before that, returns 0.
    pub fn sent(&mut self, bytes: usize) -> usize {
        self.output.advance(bytes);
        if self.output.is_empty() {
            std::mem::take(&mut self.unsent)
        } else {
            0
        }
    }

    /// Puts a part of `messages` into the output: several whole messages, or a fragment of the first one. The next call
    /// continues after it.
    pub fn put<'a>(&mut self, messages: impl Iterator<Item = &'a Bytes>) {
        for message in messages {
            let mut rest = message.as_ref();
            while !rest.is_empty() {
                let most = FRAGMENT.saturating_sub(self.unsent);
                let kind = self.unfinished.unwrap_or_else(|| kind_of(rest));
                let (piece, taken, is_last) = first_piece(rest, kind == opcode::TEXT, most);
                if self.unsent > 0 && !is_last {
                    return;
                }
                self.unsent += taken;
                rest.advance(taken);
                let opcode = match self.unfinished {
                    Some(_) => opcode::CONTINUATION,
                    None => kind,
                };
                self.unfinished = (!is_last).then_some(kind);
                append_frame(&mut self.output, opcode, is_last, piece);
                if !is_last {
                    return;
                }
            }
        }
    }

    /// Puts the answer to a ping, unless the close frame has been put.
    pub fn put_pong(&mut self, ping: &[u8]) {
        if !self.is_closing {
            append_frame(&mut self.output, opcode::PONG, true, ping);
        }
    }

    /// Puts the close frame, once.
    pub fn put_close(&mut self) {
        if self.is_closing {
            return;
        }
        self.is_closing = true;
        let shutdown = (Some(GOING_AWAY), "shutting down");
        let (code, why) = self.close_reason.unwrap_or(shutdown);
        let code = code.map(u16::to_be_bytes);
        let mut payload = code.into_iter().flatten().collect::<Vec<u8>>();
        payload.extend_from_slice(why.as_bytes());
        append_frame(&mut self.output, opcode::CLOSE, true, &payload);
    }

    /// Makes the close frame the answer to this end.
    pub const fn answer(&mut self, end: SocketEnd) {
        self.close_reason = Some(match end {
            SocketEnd::Closed(code) => (code, ""),
            SocketEnd::Violated => (Some(PROTOCOL_ERROR), "violates RFC 6455"),
        });
    }

    /// Makes `why` the reason in the close frame, for a peer that breaks a rule of the server.
    pub const fn refuse(&mut self, why: &'static str) {
        self.close_reason = Some((Some(POLICY_VIOLATION), why));
    }
}

/// The two directions of a WebSocket.
#[derive(Debug, Default)]
pub struct WebSocket {
    /// The input.
    pub incoming: MessageReader,
    /// The output.
    pub outgoing: MessageWriter,
}

impl WebSocket {
    /// Why no more messages follow. The close frame answers it.
    pub const fn end(&mut self) -> Option<SocketEnd> {
        let end = self.incoming.end();
        if let Some(end) = end {
            self.outgoing.answer(end);
        }
        end
    }

    /// The bytes that are to be sent next: the rest of the output, or else the answer to the latest ping.
    pub fn output(&mut self) -> Option<&BytesMut> {
        if self.outgoing.output().is_empty() {
            self.outgoing.put_pong(&self.incoming.take_ping()?);
        }
        Some(self.outgoing.output()).filter(|output| !output.is_empty())
    }
}

/// The kind of a message: JSON begins with a brace, CBOR never does.
fn kind_of(message: &[u8]) -> u8 {
    if message.first() == Some(&b'{') {
        opcode::TEXT
    } else {
        opcode::BINARY
    }
}

/// The part of `bytes` that fits into one frame, the number of `bytes` that it takes, and whether a message ends there.
/// A text may be several messages, one per line. The end of a line is not sent.
fn first_piece(bytes: &[u8], is_text: bool, most: usize) -> (&[u8], usize, bool) {
    let offered = bytes.get(..most).unwrap_or(bytes);
    let end = || offered.iter().position(|&byte| byte == b'\n');
    let line = is_text
        .then(end)
        .flatten()
        .and_then(|end| offered.get(..end));
    line.map_or(
        (offered, offered.len(), offered.len() == bytes.len()),
        |line| (line, line.len() + 1, true),
    )
}

/// Appends a frame to `out`, as a server sends it.
pub fn append_frame(out: &mut BytesMut, opcode: u8, is_last: bool, payload: &[u8]) {
    out.put_u8(if is_last { opcode | LAST } else { opcode });
    let length = payload.len();
    match (u8::try_from(length), u16::try_from(length)) {
        (Ok(short @ ..126), _) => out.put_u8(short),
        (_, Ok(length)) => {
            out.put_u8(126);
            out.put_u16(length);
        }
        _ => {
            out.put_u8(127);
            out.put_u64(length as u64);
        }
    }
    out.extend_from_slice(payload);
}
