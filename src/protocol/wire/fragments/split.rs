//! A long message, cut into pieces for a subscriber.
//!
//! **Invariant:** pieces put together are the message again, and none is longer than was asked for.

use bytes::Bytes;
use serde::Serialize;

/// The smallest pieces sent: smaller ones would be frame more than content.
pub const MIN_SIZE: usize = 64;

#[derive(Serialize)]
struct Fragment<'a> {
    op: &'static str,
    id: &'a str,
    data: &'a str,
    num: usize,
    total: usize,
}

/// A frame in pieces of at most `size` bytes of text each, one line per piece. A frame that is no longer than that
/// stays as it is. `None` if the lines have more than `most` bytes.
#[must_use]
pub fn split(frame: &Bytes, size: usize, id: &str, most: usize) -> Option<Bytes> {
    let text = frame.strip_suffix(b"\n").unwrap_or(frame);
    let text = std::str::from_utf8(text).ok();
    let Some(text) = text.filter(|text| text.len() > size) else {
        return Some(frame.clone());
    };
    let size = size.max(MIN_SIZE);
    if least_length(text, size, id) > most {
        return None;
    }
    // A piece must not end within a character: the longest has four bytes.
    let mut pieces = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (piece, behind) = rest.split_at(boundary(rest, size));
        pieces.push(piece);
        rest = behind;
    }
    let total = pieces.len();
    let mut lines = Vec::with_capacity(most.min(text.len() + total * 96));
    for (num, data) in pieces.into_iter().enumerate() {
        let fragment = Fragment {
            op: "fragment",
            id,
            data,
            num,
            total,
        };
        let written = serde_json::to_writer(&mut lines, &fragment);
        debug_assert!(written.is_ok(), "text can always be written as JSON");
        if written.is_err() || lines.len() >= most {
            return None;
        }
        lines.push(b'\n');
    }
    lines.shrink_to_fit();
    Some(Bytes::from(lines))
}

/// The least bytes that the pieces of a text can have: pieces that would be too long are not made first.
fn least_length(text: &str, size: usize, id: &str) -> usize {
    const SHORTEST: usize = r#"{"op":"fragment","id":"","data":"","num":0,"total":0}"#.len() + 1;
    let escaped = text.bytes().filter(|byte| matches!(byte, b'"' | b'\\'));
    text.len() + escaped.count() + text.len().div_ceil(size) * (SHORTEST + id.len())
}

/// The last boundary of characters at or before `at`.
fn boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    let boundary = (0..=at).rev().find(|&at| text.is_char_boundary(at));
    boundary.unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;
    use crate::protocol::wire::fragments::{Complete, Fragments, Piece};

    /// Characters of one to four bytes, cut at every size: together again they are what they were.
    #[test]
    fn a_frame_in_pieces_is_the_frame_again() {
        let text = format!("{{\"msg\":\"{}\"}}", "aä€😀\\\"".repeat(40));
        let frame = Bytes::from(format!("{text}\n"));
        assert_eq!(split(&frame, text.len(), "id", 0), Some(frame.clone()));
        for size in MIN_SIZE..MIN_SIZE + 8 {
            let mut fragments = Fragments::default();
            let mut whole = None;
            let lines = split(&frame, size, "id", usize::MAX).unwrap();
            let within = |most: usize| split(&frame, size, "id", most).is_some();
            assert!(within(lines.len()) && !within(lines.len() - 1));
            let lines = lines.strip_suffix(b"\n").unwrap();
            for line in lines.split(|byte| *byte == b'\n') {
                let line: serde_json::Value = serde_json::from_slice(line).unwrap();
                let number = |name: &str| usize::try_from(line[name].as_u64().unwrap()).unwrap();
                let data = line["data"].as_str().unwrap();
                assert!(data.len() <= size && line["id"] == "id" && line["op"] == "fragment");
                let piece = Piece {
                    id: "id".to_owned(),
                    data: data.to_owned(),
                    num: number("num"),
                    total: number("total"),
                };
                whole = fragments.take(piece, Instant::now()).unwrap();
            }
            assert_eq!(whole.map(Complete::text).as_deref(), Some(&*text));
        }
    }
}
