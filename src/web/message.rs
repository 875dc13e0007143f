//! A WebSocket message into a frame of the stream that the connection reads.
//!
//! A message may be pretty-printed: there, line ends are white space. In the stream a line end ends the frame, and a
//! frame that passes through to other clients must stay on its line, so line ends become spaces. Within a string they
//! are no valid JSON, and must not become valid: a carriage return, as invalid there, takes their place.
//!
//! **Invariant:** what is appended has exactly one newline, its last byte.

use bytes::BytesMut;

/// Appends a message as one line.
pub fn append_line(message: &[u8], stream: &mut BytesMut) {
    stream.reserve(message.len() + 1);
    if !message.contains(&b'\n') {
        stream.extend_from_slice(message);
        stream.extend_from_slice(b"\n");
        return;
    }
    let mut in_string = false;
    let mut escaped = false;
    for &byte in message {
        let kept = match byte {
            b'\n' if in_string => b'\r',
            b'\n' => b' ',
            byte => byte,
        };
        stream.extend_from_slice(&[kept]);
        match byte {
            b'"' if !escaped => in_string = !in_string,
            b'\\' if in_string && !escaped => {
                escaped = true;
                continue;
            }
            _ => {}
        }
        escaped = false;
    }
    stream.extend_from_slice(b"\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::op;
    use crate::protocol::wire::frame::FrameReader;

    fn line(message: &str) -> String {
        let mut stream = BytesMut::new();
        append_line(message.as_bytes(), &mut stream);
        String::from_utf8(stream.to_vec()).unwrap()
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
