//! Long messages in pieces: `fragment` in both directions.
//!
//! They are [sent](split()) only to subscribers with a `fragment_size`, and accepted from any client, within
//! bounds. The caller passes the time.
//!
//! **Invariant:** at most one unfinished message is stored, of at most [`MAX_FRAME`] bytes, for at most [`MAX_AGE`].

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use bytes::Bytes;
use serde::Serialize;

use super::fault::start_of;
use crate::protocol::limits::MAX_FRAME;

/// Pieces of one message: each of a longest frame's has a kilobyte.
pub const MAX_PIECES: usize = 4096;
/// Bytes of a piece besides its text: its table entry and the allocator's overhead.
pub const PIECE_BYTES: usize = 128;
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
    /// The piece's number is too large.
    #[error("fragment: num must be less than total, got {num} of {total}")]
    NoSuchPiece {
        /// The piece.
        num: usize,
        /// The number of pieces.
        total: usize,
    },
    /// Too many pieces.
    #[error("fragment: total must be at most {MAX_PIECES}, got {0}")]
    TooMany(usize),
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
    pieces: BTreeMap<usize, String>,
    /// Bytes of these.
    bytes: usize,
}

/// A message with all its pieces. Joining megabytes of them takes milliseconds.
#[derive(Debug, PartialEq, Eq)]
pub struct Complete {
    pieces: BTreeMap<usize, String>,
    bytes: usize,
}

impl Complete {
    /// Bytes of the whole text.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes
    }

    /// The whole text.
    #[must_use]
    pub fn text(self) -> String {
        let mut text = String::with_capacity(self.bytes);
        text.extend(self.pieces.into_values());
        text
    }
}

impl Fragments {
    /// Takes a piece. Returns the message with its last missing piece. A repeated piece counts once.
    ///
    /// # Errors
    /// [`FragmentError`] if the piece exceeds a bound, with the first bytes of the message, if its first piece has
    /// arrived.
    pub fn take(
        &mut self,
        piece: Piece,
        now: Instant,
    ) -> Result<Option<Complete>, (FragmentError, Vec<u8>)> {
        let Piece {
            id,
            data,
            num,
            total,
        } = piece;
        self.forget_old(now);
        let before = self.message.take().filter(|one| one.id == id);
        let mut message = before.unwrap_or_else(|| Incomplete {
            id,
            began: now,
            total,
            pieces: BTreeMap::new(),
            bytes: 0,
        });
        if let Err(why) = message.check(num, total, data.len()) {
            let first = message.pieces.remove(&0);
            let first = first.or_else(|| Some(data).filter(|_| num == 0));
            return Err((why, start_of(first.unwrap_or_default().as_bytes())));
        }
        message.bytes += data.len();
        if let Some(before) = message.pieces.insert(num, data) {
            message.bytes -= before.len();
        }
        if message.pieces.len() < total {
            self.message = Some(message);
            return Ok(None);
        }
        Ok(Some(Complete {
            bytes: message.bytes,
            pieces: message.pieces,
        }))
    }

    /// Bytes of memory that this takes: pieces without text take some too, and so does an id.
    #[must_use]
    pub fn allocated(&self) -> usize {
        self.message.as_ref().map_or(0, |one| {
            one.bytes + one.id.len() + PIECE_BYTES * (1 + one.pieces.len())
        })
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

impl Incomplete {
    /// Whether there is room for a piece of that number and length.
    fn check(&self, num: usize, total: usize, length: usize) -> Result<(), FragmentError> {
        let before = self.total;
        let replaced = self.pieces.get(&num).map_or(0, String::len);
        if num >= total {
            Err(FragmentError::NoSuchPiece { num, total })
        } else if total > MAX_PIECES {
            Err(FragmentError::TooMany(total))
        } else if before != total {
            Err(FragmentError::Changed { before, now: total })
        } else if self.bytes - replaced + length > MAX_FRAME {
            Err(FragmentError::TooLong)
        } else {
            Ok(())
        }
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
    fn a_piece_that_comes_twice_takes_the_room_of_the_first() {
        let half = "x".repeat(MAX_FRAME / 2);
        let (mut fragments, now) = (Fragments::default(), Instant::now());
        for _ in 0..3 {
            assert_eq!(fragments.take(piece("a", 0, 2, &half), now), Ok(None));
        }
        let whole = fragments.take(piece("a", 1, 2, &half), now).unwrap();
        assert_eq!(whole.map(Complete::text), Some(half.repeat(2)));
        assert_eq!(fragments.allocated(), 0);
    }

    #[test]
    fn a_fragment_beyond_a_bound_is_refused_with_its_message() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        let (many, long) = (MAX_PIECES + 1, "x".repeat(MAX_FRAME));
        let changed = FragmentError::Changed { before: 2, now: 3 };
        let none = |num, total| FragmentError::NoSuchPiece { num, total };
        for (bad, why, start) in [
            (piece("a", 1, 3, "y"), changed, "x"),
            (piece("a", 2, 2, "y"), none(2, 2), "x"),
            (piece("b", 0, 0, "y"), none(0, 0), "y"),
            (piece("b", 2, 2, "y"), none(2, 2), ""),
            (piece("b", 0, many, "y"), FragmentError::TooMany(many), "y"),
            (piece("a", 1, 2, &long), FragmentError::TooLong, "x"),
        ] {
            fragments.take(piece("a", 0, 2, "x"), now).unwrap();
            let refused = fragments.take(bad, now);
            assert_eq!(refused, Err((why, start.into())));
            assert_eq!((fragments.allocated(), fragments.began()), (0, None));
        }
        let most = fragments.take(piece("a", 0, MAX_PIECES, "x"), now);
        assert_eq!(most, Ok(None));
    }

    #[test]
    fn an_unfinished_message_is_forgotten_after_a_minute_and_when_another_begins() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        fragments.take(piece("a", 0, 2, "one"), now).unwrap();
        assert_eq!(fragments.allocated(), 3 + 1 + 2 * PIECE_BYTES);
        fragments.forget_old(now + MAX_AGE);
        assert_eq!(fragments.began(), Some(now));
        fragments.forget_old(now + MAX_AGE + Duration::from_nanos(1));
        assert_eq!(fragments.began(), None);
        fragments.take(piece("a", 0, 2, "one"), now).unwrap();
        fragments.take(piece("b", 0, 2, "{"), now).unwrap();
        assert_eq!(fragments.take(piece("a", 1, 2, "two"), now), Ok(None));
        assert_eq!(fragments.take(piece("b", 1, 2, "}"), now), Ok(None));
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
            assert_eq!(whole.map(Complete::text).as_deref(), Some(&*text));
        }
    }
}
