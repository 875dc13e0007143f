//! Long messages in pieces: `fragment` in both directions.
//!
//! They are [sent](split()) only to subscribers with a `fragment_size`, and accepted from any client, within
//! bounds. The caller passes the time.
//!
//! **Invariant:** incomplete messages have at most [`MAX_FRAME`] bytes together. There are at most
//! [`MAX_UNFINISHED`] of them, none older than [`MAX_AGE`].

use std::collections::{BTreeMap, HashMap};
use std::time::{Duration, Instant};

use bytes::Bytes;
use serde::Serialize;

use super::frame::start_of;
use crate::protocol::limits::MAX_FRAME;

/// Most incomplete messages of one connection. Clients send one after the other.
pub const MAX_UNFINISHED: usize = 8;
/// Most pieces of one message: a kilobyte each for the longest frame.
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
    /// Too many messages at once.
    #[error("fragment: at most {MAX_UNFINISHED} messages may be incomplete at once")]
    TooManyMessages,
    /// Too long.
    #[error("fragment: incomplete messages must have at most {MAX_FRAME} bytes together")]
    TooLong,
}

/// The incomplete messages of one connection.
#[derive(Debug, Default)]
pub struct Fragments {
    messages: HashMap<String, Incomplete>,
}

#[derive(Debug)]
struct Incomplete {
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
        self.forget_old(now);
        let checked = self.check(&piece);
        let Piece {
            id,
            data,
            num,
            total,
        } = piece;
        if let Err(why) = checked {
            let before = self.messages.remove(&id);
            let first = before.and_then(|mut one| one.pieces.remove(&0));
            let first = first.or_else(|| Some(data).filter(|_| num == 0));
            return Err((why, start_of(first.unwrap_or_default().as_bytes())));
        }
        let begin = || Incomplete {
            began: now,
            total,
            pieces: BTreeMap::new(),
            bytes: 0,
        };
        let unfinished = self.messages.entry(id.clone()).or_insert_with(begin);
        unfinished.bytes += data.len();
        if let Some(before) = unfinished.pieces.insert(num, data) {
            unfinished.bytes -= before.len();
        }
        if unfinished.pieces.len() < total {
            return Ok(None);
        }
        Ok(self.messages.remove(&id).map(|whole| Complete {
            bytes: whole.bytes,
            pieces: whole.pieces,
        }))
    }

    fn bytes(&self) -> usize {
        self.messages.values().map(|one| one.bytes).sum()
    }

    /// Bytes of memory in use. Pieces without text and ids count too.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let beside = self.messages.iter();
        let beside = beside.map(|(id, one)| id.len() + PIECE_BYTES * (1 + one.pieces.len()));
        self.bytes() + beside.sum::<usize>()
    }

    /// When the oldest unfinished message began.
    #[must_use]
    pub fn oldest(&self) -> Option<Instant> {
        self.messages.values().map(|one| one.began).min()
    }

    fn check(&self, piece: &Piece) -> Result<(), FragmentError> {
        let &Piece { num, total, .. } = piece;
        if num >= total {
            return Err(FragmentError::NoSuchPiece { num, total });
        }
        if total > MAX_PIECES {
            return Err(FragmentError::TooMany(total));
        }
        let message = self.messages.get(&piece.id);
        match message.map(|one| one.total) {
            Some(before) if before != total => {
                return Err(FragmentError::Changed { before, now: total });
            }
            None if self.messages.len() >= MAX_UNFINISHED => {
                return Err(FragmentError::TooManyMessages);
            }
            _ => {}
        }
        let replaced = message.and_then(|one| one.pieces.get(&num));
        let replaced = replaced.map_or(0, String::len);
        if self.bytes() - replaced + piece.data.len() > MAX_FRAME {
            return Err(FragmentError::TooLong);
        }
        Ok(())
    }

    /// Discards messages older than [`MAX_AGE`].
    pub fn forget_old(&mut self, now: Instant) {
        self.messages
            .retain(|_, one| now.saturating_duration_since(one.began) <= MAX_AGE);
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
    fn a_piece_that_comes_twice_takes_the_room_of_the_first() {
        let half = "x".repeat(MAX_FRAME / 2);
        let (mut fragments, now) = (Fragments::default(), Instant::now());
        for _ in 0..3 {
            assert_eq!(fragments.take(piece("a", 0, 2, &half), now), Ok(None));
        }
        let whole = fragments.take(piece("a", 1, 2, &half), now).unwrap();
        assert_eq!(whole.map(Complete::text), Some(half.repeat(2)));
        assert_eq!(fragments.bytes(), 0);
    }

    #[test]
    fn pieces_make_a_message_in_whatever_order_they_come() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        assert_eq!(fragments.take(piece("a", 2, 3, "z"), now), Ok(None));
        assert_eq!(fragments.take(piece("b", 0, 2, "other"), now), Ok(None));
        assert_eq!(fragments.take(piece("a", 0, 3, "x"), now), Ok(None));
        assert_eq!(fragments.take(piece("a", 0, 3, "x"), now), Ok(None));
        let whole = fragments.take(piece("a", 1, 3, "y"), now).unwrap();
        assert_eq!(whole.map(Complete::text), Some("xyz".to_owned()));
        assert_eq!(fragments.bytes(), "other".len());
    }

    #[test]
    fn what_breaks_a_bound_is_refused_and_its_message_forgotten() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        fragments.take(piece("a", 0, 2, "x"), now).unwrap();
        let half = "x".repeat(MAX_FRAME / 2 + 1);
        for (bad, why) in [
            (
                piece("a", 1, 3, "y"),
                FragmentError::Changed { before: 2, now: 3 },
            ),
            (
                piece("a", 2, 2, "y"),
                FragmentError::NoSuchPiece { num: 2, total: 2 },
            ),
            (
                piece("a", 0, 0, "y"),
                FragmentError::NoSuchPiece { num: 0, total: 0 },
            ),
            (
                piece("a", 0, MAX_PIECES + 1, "y"),
                FragmentError::TooMany(MAX_PIECES + 1),
            ),
        ] {
            let refused = fragments.take(bad, now).map_err(|(error, _)| error);
            assert_eq!(refused, Err(why));
            assert!(fragments.messages.is_empty());
            assert_eq!(fragments.bytes(), 0);
            fragments.take(piece("a", 0, 2, "x"), now).unwrap();
        }
        fragments.take(piece("b", 0, 3, &half), now).unwrap();
        let long = fragments.take(piece("b", 1, 3, &half), now);
        assert_eq!(long.unwrap_err().0, FragmentError::TooLong);
        assert_eq!(fragments.bytes(), 1);
        for number in 1..MAX_UNFINISHED {
            fragments
                .take(piece(&number.to_string(), 0, 2, "x"), now)
                .unwrap();
        }
        let more = fragments.take(piece("more", 0, 2, "x"), now);
        assert_eq!(more.unwrap_err().0, FragmentError::TooManyMessages);
        let later = now + MAX_AGE + Duration::from_secs(1);
        assert_eq!(fragments.take(piece("more", 0, 2, "x"), later), Ok(None));
        assert_eq!(fragments.messages.len(), 1, "old ones are forgotten");
    }

    #[test]
    fn the_bounds_themselves_are_within_bounds() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        assert_eq!(
            fragments.take(piece("a", 0, MAX_PIECES, "x"), now),
            Ok(None)
        );
        let half = "x".repeat(MAX_FRAME / 2);
        let mut fragments = Fragments::default();
        assert_eq!(fragments.take(piece("a", 0, 2, &half), now), Ok(None));
        let whole = fragments.take(piece("a", 1, 2, &half), now).unwrap();
        assert_eq!(whole.map(|whole| whole.bytes()), Some(MAX_FRAME));
    }

    #[test]
    fn what_is_forgotten_makes_room() {
        let now = Instant::now();
        let much = "x".repeat(MAX_FRAME / 2 + 1);
        let mut fragments = Fragments::default();
        fragments.take(piece("old", 0, 2, &much), now).unwrap();
        let at_last = now + MAX_AGE;
        let more = fragments.take(piece("new", 0, 2, &much), at_last);
        assert_eq!(more.unwrap_err().0, FragmentError::TooLong);
        let later = at_last + Duration::from_nanos(1);
        assert_eq!(fragments.take(piece("new", 0, 2, &much), later), Ok(None));
        assert_eq!(fragments.bytes(), much.len());
    }

    #[test]
    fn what_is_kept_is_known_by_its_bytes_and_its_oldest() {
        let now = Instant::now();
        let mut fragments = Fragments::default();
        assert_eq!((fragments.bytes(), fragments.oldest()), (0, None));
        fragments.take(piece("a", 0, 2, "one"), now).unwrap();
        let later = now + Duration::from_secs(1);
        fragments.take(piece("b", 0, 2, "three"), later).unwrap();
        assert_eq!((fragments.bytes(), fragments.oldest()), (8, Some(now)));
        fragments.forget_old(now + MAX_AGE);
        assert_eq!(fragments.bytes(), 8);
        fragments.forget_old(later + MAX_AGE);
        assert_eq!((fragments.bytes(), fragments.oldest()), (5, Some(later)));
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
