//! Long messages in pieces: `fragment` in both directions.
//!
//! They are [sent](split()) only to subscribers with a `fragment_size`, and accepted from any client, within
//! bounds. The caller passes the time.
//!
//! **Invariant:** at most one unfinished message is stored, of at most [`MAX_FRAME`] bytes, for at most [`MAX_AGE`].

use std::time::{Duration, Instant};

use bytes::Bytes;
use serde::Serialize;

use super::frame::start_of;
use crate::protocol::limits::MAX_FRAME;

/// Longest time for all pieces of a message: longer than on the slowest usable network.
pub const MAX_AGE: Duration = Duration::from_secs(60);

/// A piece of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Piece {
    /// The sender's id of the message (the text of any JSON value).
    pub id: String,
    /// The text.
    pub data: String,
    /// The piece's number, from 0.
    pub num: usize,
    /// The number of pieces.
    pub total: usize,
}

/// Why a piece is refused. The pieces of its message are then discarded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FragmentError {
    /// Another piece is next, or there is no such piece.
    #[error("fragment: num must be {due} and less than total, got {num} of {total}")]
    NotDue {
        /// The number of the next piece.
        due: usize,
        /// The piece.
        num: usize,
        /// The number of pieces.
        total: usize,
    },
    /// The number of pieces has changed.
    #[error("fragment: total must stay {before}, got {now}")]
    Changed {
        /// The previous number.
        before: usize,
        /// The new number.
        now: usize,
    },
    /// Too long.
    #[error("fragment: incomplete messages must have at most {MAX_FRAME} bytes together")]
    TooLong,
}

/// The message of one connection that is still incomplete: clients send one after the other. The next one takes its
/// place.
#[derive(Debug, Default)]
pub struct Fragments {
    message: Option<Incomplete>,
}

#[derive(Debug)]
struct Incomplete {
    id: String,
    began: Instant,
    total: usize,
    /// The number of pieces so far.
    count: usize,
    /// Their text.
    text: String,
}

impl Fragments {
    /// Takes the next piece of a message. Returns the whole text with its last piece.
    ///
    /// # Errors
    /// [`FragmentError`] if the piece is not the next one or exceeds a bound, with the first bytes of the message.
    pub fn take(
        &mut self,
        piece: Piece,
        now: Instant,
    ) -> Result<Option<String>, (FragmentError, Vec<u8>)> {
        self.forget_old(now);
        let before = self.message.take().filter(|one| one.id == piece.id);
        let mut message = before.unwrap_or_else(|| Incomplete {
            id: piece.id,
            began: now,
            total: piece.total,
            count: 0,
            text: String::new(),
        });
        let Incomplete { total, count, .. } = message;
        let length = message.text.len() + piece.data.len();
        let why = if total != piece.total {
            let (before, now) = (total, piece.total);
            Some(FragmentError::Changed { before, now })
        } else if piece.num != count || count >= total {
            let (due, num) = (count, piece.num);
            Some(FragmentError::NotDue { due, num, total })
        } else {
            Some(FragmentError::TooLong).filter(|_| length > MAX_FRAME)
        };
        if let Some(why) = why {
            if count == 0 && piece.num == 0 {
                message.text = piece.data;
            }
            return Err((why, start_of(message.text.as_bytes())));
        }
        if length > message.text.capacity() {
            // Doubled, but never beyond the longest message.
            let wanted = length.max(2 * message.text.len()).min(MAX_FRAME);
            message.text.reserve_exact(wanted - message.text.len());
        }
        message.text += &piece.data;
        message.count += 1;
        if message.count == total {
            return Ok(Some(message.text));
        }
        self.message = Some(message);
        Ok(None)
    }

    /// Bytes of memory that this takes.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let message = self.message.as_ref();
        message.map_or(0, |one| one.text.capacity() + one.id.len())
    }

    /// When the unfinished message began.
    #[must_use]
    pub fn began(&self) -> Option<Instant> {
        self.message.as_ref().map(|one| one.began)
    }

    /// Forgets a message that takes longer than [`MAX_AGE`].
    pub fn forget_old(&mut self, now: Instant) {
        let is_young = |one: &Incomplete| now.saturating_duration_since(one.began) <= MAX_AGE;
        self.message = self.message.take().filter(is_young);
    }
}

// ---- a long message, cut into pieces for a subscriber: none is longer than was asked for ----------------------------

/// The smallest pieces that are sent. Smaller ones would have more overhead than content.
pub const MIN_SIZE: usize = 64;

#[derive(Serialize)]
struct Fragment<'a> {
    op: &'static str,
    id: &'a str,
    data: &'a str,
    num: usize,
    total: usize,
}

/// A frame in pieces of at most `size` bytes of text each, one line per piece. A shorter frame does not change.
/// `None` if the lines have more than `most` bytes.
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
    // A piece must not end inside a character, which has up to four bytes.
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

/// The least total bytes of a text's pieces. So pieces that would be too long are never made.
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
    use super::*;

    fn piece(id: &str, num: usize, total: usize, data: &str) -> Piece {
        Piece {
            id: id.to_owned(),
            data: data.to_owned(),
            num,
            total,
        }
    }

    #[test]
    fn a_piece_out_of_order_or_beyond_a_bound_is_refused_with_its_message() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        let not_due = |due, num, total| FragmentError::NotDue { due, num, total };
        for (bad, why) in [
            (
                piece("a", 1, 3, "y"),
                FragmentError::Changed { before: 2, now: 3 },
            ),
            (piece("a", 0, 2, "y"), not_due(1, 0, 2)),
            (piece("a", 2, 2, "y"), not_due(1, 2, 2)),
            (piece("b", 1, 2, "y"), not_due(0, 1, 2)),
            (piece("b", 0, 0, "y"), not_due(0, 0, 0)),
            (
                piece("a", 1, 2, &"x".repeat(MAX_FRAME)),
                FragmentError::TooLong,
            ),
        ] {
            fragments.take(piece("a", 0, 2, "x"), now).unwrap();
            let refused = fragments.take(bad, now).map_err(|(error, _)| error);
            assert_eq!(refused, Err(why));
            assert_eq!((fragments.allocated(), fragments.began()), (0, None));
        }
    }

    /// As many bytes as a frame may have, in pieces of any length.
    #[test]
    fn pieces_take_at_most_the_memory_of_the_longest_frame() {
        for pieces in [2, 3, 1000, 4096] {
            let (mut fragments, now) = (Fragments::default(), Instant::now());
            let data = "x".repeat(MAX_FRAME / pieces);
            for num in 0..pieces - 1 {
                let taken = fragments.take(piece("a", num, pieces, &data), now);
                assert_eq!(taken, Ok(None));
                assert!(fragments.allocated() <= MAX_FRAME + 1);
            }
            let whole = fragments.take(piece("a", pieces - 1, pieces, &data), now);
            assert_eq!(whole, Ok(Some(data.repeat(pieces))));
            assert_eq!(fragments.allocated(), 0);
        }
    }

    #[test]
    fn an_unfinished_message_is_forgotten_after_a_minute_and_when_another_begins() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        fragments.take(piece("a", 0, 2, "one"), now).unwrap();
        fragments.forget_old(now + MAX_AGE);
        assert_eq!(fragments.began(), Some(now));
        fragments.forget_old(now + MAX_AGE + Duration::from_nanos(1));
        assert_eq!(fragments.began(), None);
        fragments.take(piece("a", 0, 2, "one"), now).unwrap();
        fragments.take(piece("b", 0, 2, "{"), now).unwrap();
        let whole = fragments.take(piece("b", 1, 2, "}"), now).unwrap();
        assert_eq!(whole.as_deref(), Some("{}"));
    }

    /// Characters of one to four bytes, split at every size, give the same text when joined.
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
            assert_eq!(whole.as_deref(), Some(&*text));
        }
    }
}
