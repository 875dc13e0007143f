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

use crate::protocol::wire::nesting::plain_in_string;

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

    /// Appends the next piece, of at most so many bytes; whether that was the last.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::op;
    use crate::protocol::wire::frame::FrameReader;

    fn line(message: &str) -> String {
        let mut stream = BytesMut::new();
        let mut line = OneLine::new(Bytes::copy_from_slice(message.as_bytes()));
        assert!(line.append(usize::MAX, &mut stream));
        String::from_utf8(stream.to_vec()).unwrap()
    }

    #[test]
    fn a_message_in_pieces_is_the_same_line() {
        for message in [
            "{\n \"op\":\n\"x\"\r\n}",
            r#"{"a":"\"\\"}"#,
            "{\"a\":\"\\\\\\\"\n\\\n\"\n,\"b\\\"\":\n[\"\",\n\"\n\"]}",
            &"{\"numbers, many of them\":[1,\n2]}".repeat(9),
            "",
        ] {
            let whole = line(message);
            for most in 1..whole.len() + 2 {
                let mut stream = BytesMut::new();
                let mut line = OneLine::new(Bytes::copy_from_slice(message.as_bytes()));
                let mut pieces = 1;
                loop {
                    let before = stream.len();
                    let is_last = line.append(most, &mut stream);
                    assert!((1..=most).contains(&(stream.len() - before)));
                    if is_last {
                        break;
                    }
                    pieces += 1;
                }
                assert_eq!(stream, whole.as_bytes(), "{most} bytes at a time");
                assert_eq!(pieces, whole.len().div_ceil(most));
            }
        }
    }

    #[test]
    fn line_ends_between_tokens_become_spaces() {
        assert_eq!(line("{\n \"op\":\n\"x\"\r\n}"), "{  \"op\": \"x\"\r }\n");
        assert_eq!(line("{}"), "{}\n");
        assert_eq!(line(""), "\n");
        assert_eq!(line(r#"{"a":"\"\\"}"#), "{\"a\":\"\\\"\\\\\"}\n");
    }

    #[test]
    fn a_line_end_within_a_string_does_not_become_valid() {
        for message in [
            "{\"op\":\"subscribe\",\"topic\":\"/a\n\"}",
            "{\"op\":\"subscribe\",\"topic\":\"\\\"/a\n{\\\"op\\\":1}\"}",
            "{\"op\":\"subscribe\",\"topic\":\"/a\\\n\"}",
        ] {
            let mut frames = FrameReader::new();
            frames.push(line(message).as_bytes());
            let frame = frames.next().unwrap().unwrap();
            assert!(op::read(&frame.text).op.is_err(), "{message:?}");
            assert_eq!(frames.next(), None);
        }
    }
}
