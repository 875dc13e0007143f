//! A WebSocket message into a frame of the stream that the connection reads.
//!
//! A message may be pretty-printed: there, line ends are white space. In the stream a line end ends the frame, and a
//! frame that passes through to other clients must stay on its line, so line ends become spaces. Within a string they
//! are no valid JSON, and must not become valid: a carriage return, as invalid there, takes their place.
//!
//! A long one is appended piece by piece, so that nobody has to look at megabytes in a row.
//!
//! **Invariant:** what is appended of a message has exactly one newline, its last byte.

use bytes::{Bytes, BytesMut};

use crate::protocol::wire::frame::plain_in_string;

/// A message that becomes a line.
#[derive(Debug)]
pub struct OneLine {
    /// Its part that is still to come.
    message: Bytes,
    /// Whether that begins within a string.
    in_string: bool,
    /// Whether it begins behind a backslash there.
    escaped: bool,
}

impl OneLine {
    /// The line of a message, of which nothing has been appended yet.
    #[must_use]
    pub const fn new(message: Bytes) -> Self {
        Self {
            message,
            in_string: false,
            escaped: false,
        }
    }

    /// Appends the next piece, of at most `most` bytes. True if it was the last.
    pub fn append(&mut self, most: usize, stream: &mut BytesMut) -> bool {
        let is_last = self.message.len() < most;
        let piece = self.message.split_to(self.message.len().min(most));
        let from = stream.len();
        stream.reserve(piece.len() + usize::from(is_last));
        stream.extend_from_slice(&piece);
        // Behind the last one nobody asks what it has ended within.
        if !is_last || piece.contains(&b'\n') {
            self.join_lines(stream.get_mut(from..).unwrap_or_default());
        }
        if is_last {
            stream.extend_from_slice(b"\n");
        }
        is_last
    }

    fn join_lines(&mut self, piece: &mut [u8]) {
        let mut at = 0;
        while at < piece.len() {
            if !self.escaped {
                at += plain_in_string(piece.get(at..).unwrap_or_default());
            }
            let Some(byte) = piece.get_mut(at) else {
                break;
            };
            let was_escaped = std::mem::take(&mut self.escaped);
            match byte {
                b'\n' => *byte = if self.in_string { b'\r' } else { b' ' },
                b'"' if !was_escaped => self.in_string = !self.in_string,
                b'\\' if !was_escaped => self.escaped = self.in_string,
                _ => {}
            }
            at += 1;
        }
    }
}
