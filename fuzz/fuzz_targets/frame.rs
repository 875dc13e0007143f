//! The frame reader against a slow model that has all bytes at once and reads them one by one.
//!
//! Asserted: reader and model find the same frames and the same malformed parts, in the same order, for any split of
//! the stream. The reader keeps a bounded part.
//!
//! Input: a byte that chooses the limit, a byte that chooses the cuts, the stream.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::limits::MAX_NESTING;
use pendularm::protocol::wire::frame::{FrameError, FrameReader};
use pendularm_fuzz::limits::{READING, hold};

fuzz_target!(|input: &[u8]| hold(input.len(), READING, || examine(input)));

fn examine(input: &[u8]) {
    let &[limit, seed, ref stream @ ..] = input else {
        return;
    };
    let limit = usize::from(limit) * 4;
    let expected = model(stream, limit);
    check(&expected, limit, std::iter::once(stream));
    check(&expected, limit, stream.chunks(1));
    check(&expected, limit, Cuts { stream, seed });
}

/// The kinds of a stretch of the stream.
#[derive(Debug, PartialEq, Eq)]
enum Outcome {
    /// The text.
    Frame(String),
    NotAnObject,
    LineEnded,
    LineEndedInString,
    StreamEnded,
    Mismatch,
    TooDeep,
    TooLong,
    NotUtf8,
}

fn check<'a>(expected: &[Outcome], limit: usize, pieces: impl Iterator<Item = &'a [u8]>) {
    let mut reader = FrameReader::with_limit(limit);
    let mut found = 0;
    let mut judge = |outcome: Result<_, FrameError>| {
        let wanted = expected.get(found).expect("no more than the model finds");
        compare(outcome, wanted, limit);
        found += 1;
    };
    for piece in pieces {
        reader.push(piece);
        // A buffer doubles when it grows, and is compacted when half of it has been read.
        assert!(reader.buffered() <= 4 * (limit + piece.len() + 64) + 16 * 1024);
        reader.by_ref().for_each(&mut judge);
    }
    reader.finish().map(Err).into_iter().for_each(&mut judge);
    assert_eq!(found, expected.len(), "{expected:?}");
}

fn compare(
    outcome: Result<pendularm::protocol::wire::Frame, FrameError>,
    wanted: &Outcome,
    limit: usize,
) {
    let same = match (&outcome, wanted) {
        (Ok(frame), Outcome::Frame(text)) => frame.text == *text,
        (Err(FrameError::TooLong(told)), Outcome::TooLong) => *told == limit,
        (Err(FrameError::NotAnObject(_)), Outcome::NotAnObject)
        | (Err(FrameError::LineEnded), Outcome::LineEnded)
        | (Err(FrameError::LineEndedInString), Outcome::LineEndedInString)
        | (Err(FrameError::StreamEnded), Outcome::StreamEnded)
        | (Err(FrameError::Mismatch { .. }), Outcome::Mismatch)
        | (Err(FrameError::TooDeep), Outcome::TooDeep)
        | (Err(FrameError::NotUtf8 { .. }), Outcome::NotUtf8) => true,
        _ => false,
    };
    assert!(same, "{outcome:?} instead of {wanted:?}");
}

/// Pieces of 0 to some dozen bytes, by the seed.
struct Cuts<'a> {
    stream: &'a [u8],
    seed: u8,
}

impl<'a> Iterator for Cuts<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.stream.is_empty() {
            return None;
        }
        self.seed = self.seed.wrapping_mul(29).wrapping_add(13);
        let length = usize::from(self.seed >> 2).min(self.stream.len());
        let (piece, rest) = self.stream.split_at(length);
        self.stream = rest;
        Some(piece)
    }
}

/// The content of a stream: frames end where their braces close, or with the line.
fn model(stream: &[u8], limit: usize) -> Vec<Outcome> {
    let mut outcomes = Vec::new();
    let mut at = 0;
    while at < stream.len() {
        match stream[at] {
            b' ' | b'\t' | b'\r' | b'\n' => at += 1,
            b'{' => {
                let (outcome, end) = object(stream, at, limit);
                outcomes.push(outcome);
                at = end;
            }
            _ => {
                outcomes.push(Outcome::NotAnObject);
                at = line_end(stream, at);
            }
        }
    }
    outcomes
}

fn line_end(stream: &[u8], from: usize) -> usize {
    let newline = stream[from..].iter().position(|byte| *byte == b'\n');
    newline.map_or(stream.len(), |offset| from + offset)
}

/// The kind of the stretch that begins with the brace at `start`, and its end. The first fault decides the kind. The
/// stretch ends as without the fault, or with the line if brackets do not match.
fn object(stream: &[u8], start: usize, limit: usize) -> (Outcome, usize) {
    let mut open = Vec::new();
    let mut in_string = false;
    let mut wrong = None;
    let mut at = start;
    while at < stream.len() {
        let byte = stream[at];
        // A newline is no part of the frame.
        if byte != b'\n' && at + 1 - start > limit {
            wrong.get_or_insert(Outcome::TooLong);
        }
        match (in_string, byte) {
            (false, b'\n') => return (wrong.unwrap_or(Outcome::LineEnded), at),
            (true, b'\n') => return (wrong.unwrap_or(Outcome::LineEndedInString), at),
            // An escaped byte has no meaning, unless it is a newline.
            (true, b'\\') if stream.get(at + 1).is_some_and(|next| *next != b'\n') => {
                at += 1;
                if at + 1 - start > limit {
                    wrong.get_or_insert(Outcome::TooLong);
                }
            }
            (_, b'"') => in_string = !in_string,
            (false, b'{' | b'[') => {
                open.push(byte);
                if open.len() > MAX_NESTING {
                    wrong.get_or_insert(Outcome::TooDeep);
                }
            }
            (false, b'}' | b']') => {
                // Brackets beyond that depth are not stored.
                let opener = if byte == b'}' { b'{' } else { b'[' };
                if open.len() <= MAX_NESTING && open.last() != Some(&opener) {
                    return (wrong.unwrap_or(Outcome::Mismatch), line_end(stream, at + 1));
                }
                open.pop();
                if open.is_empty() {
                    let outcome = wrong.unwrap_or_else(|| frame(stream, start, at + 1));
                    return (outcome, at + 1);
                }
            }
            _ => {}
        }
        at += 1;
    }
    (wrong.unwrap_or(Outcome::StreamEnded), stream.len())
}

fn frame(stream: &[u8], start: usize, end: usize) -> Outcome {
    match std::str::from_utf8(&stream[start..end]) {
        Ok(text) => Outcome::Frame(accept(text)),
        Err(_) => Outcome::NotUtf8,
    }
}

/// The text with Python's names for numbers that are not finite as literals that overflow.
fn accept(text: &str) -> String {
    let mut accepted = String::new();
    let mut token = String::new();
    let mut in_string = false;
    let mut characters = text.chars();
    while let Some(character) = characters.next() {
        let is_token = character.is_ascii_alphanumeric() || "_.+-".contains(character);
        if is_token && !in_string {
            token.push(character);
            continue;
        }
        accepted.push_str(literal(&token));
        token.clear();
        accepted.push(character);
        match character {
            '"' => in_string = !in_string,
            '\\' if in_string => accepted.extend(characters.next()),
            _ => {}
        }
    }
    accepted + literal(&token)
}

fn literal(token: &str) -> &str {
    match token {
        "NaN" => "9e999",
        "Infinity" => "1e999",
        "-Infinity" => "-1e999",
        other => other,
    }
}
