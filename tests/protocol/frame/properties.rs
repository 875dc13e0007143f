//! Any stream, cut anywhere, against the rules of frames written down slowly.

use pendularm::protocol::limits::MAX_NESTING;
use pendularm::protocol::wire::frame::{FrameError, FrameReader, opening};
use proptest::prelude::*;

use super::{Outcome, nested, outcomes, read};

/// The outcome of a stretch of the stream, in the model's coarser terms.
#[derive(Debug, PartialEq)]
enum Expected {
    Frame(Vec<u8>),
    NotAnObject,
    LineEnded,
    StreamEnded,
    Mismatch,
    TooDeep,
    NotUtf8,
}

/// The rules of frames, written down as slowly as they read. Too long does not occur in it.
fn model(stream: &[u8]) -> Vec<Expected> {
    let line_end = |from: usize| {
        stream[from..]
            .iter()
            .position(|&byte| byte == b'\n')
            .map_or(stream.len(), |at| from + at)
    };
    let mut found = Vec::new();
    let mut at = 0;
    while at < stream.len() {
        if matches!(stream[at], b' ' | b'\t' | b'\r' | b'\n') {
            at += 1;
        } else if stream[at] != b'{' {
            found.push(Expected::NotAnObject);
            at = line_end(at);
        } else {
            let (outcome, end) = model_object(stream, at);
            found.push(outcome);
            at = end.unwrap_or_else(|| line_end(at));
        }
    }
    found
}

/// An object from `start` on, and where it ends; `None` if at the line's end.
fn model_object(stream: &[u8], start: usize) -> (Expected, Option<usize>) {
    let mut open = Vec::new();
    let mut string = false;
    let mut skip = false;
    let mut too_deep = false;
    for at in start..stream.len() {
        let byte = stream[at];
        let closes = matches!((open.last(), byte), (Some(b'{'), b'}') | (Some(b'['), b']'));
        match byte {
            b'\n' if too_deep => return (Expected::TooDeep, None),
            b'\n' => return (Expected::LineEnded, None),
            _ if skip => skip = false,
            b'\\' if string => skip = true,
            b'"' => string = !string,
            _ if string => {}
            b'{' | b'[' => {
                open.push(byte);
                too_deep |= open.len() > MAX_NESTING;
            }
            // Below the limit of nesting brackets are only counted.
            b'}' | b']' if closes || open.len() > MAX_NESTING => {
                open.pop();
                if open.is_empty() {
                    let text = &stream[start..=at];
                    let outcome = match std::str::from_utf8(text) {
                        _ if too_deep => Expected::TooDeep,
                        Ok(_) => Expected::Frame(text.to_vec()),
                        Err(_) => Expected::NotUtf8,
                    };
                    return (outcome, Some(at + 1));
                }
            }
            b'}' | b']' if too_deep => return (Expected::TooDeep, None),
            b'}' | b']' => return (Expected::Mismatch, None),
            _ => {}
        }
    }
    (
        if too_deep {
            Expected::TooDeep
        } else {
            Expected::StreamEnded
        },
        Some(stream.len()),
    )
}

fn in_terms_of_the_model(outcome: &Outcome) -> Expected {
    match outcome {
        Ok(text) => Expected::Frame(text.clone().into_bytes()),
        Err(FrameError::NotAnObject(_)) => Expected::NotAnObject,
        Err(FrameError::LineEnded | FrameError::LineEndedInString) => Expected::LineEnded,
        Err(FrameError::StreamEnded) => Expected::StreamEnded,
        Err(FrameError::Mismatch { .. }) => Expected::Mismatch,
        Err(FrameError::TooDeep) => Expected::TooDeep,
        Err(FrameError::NotUtf8 { .. }) => Expected::NotUtf8,
        Err(FrameError::TooLong(_)) => panic!("nothing here is that long"),
        Err(FrameError::MoreBehind) => panic!("this is no stream of messages"),
    }
}

/// Streams in which what matters to the reader is frequent.
fn stream() -> impl Strategy<Value = Vec<u8>> {
    let bits = prop_oneof![
        8 => proptest::sample::select(vec![
            "{", "}", "[", "]", "\"", "\\", "\n", "\r\n", " ", ",", ":", "1", "a", "é", "{}", "{\"a\":1}", "\"x\"",
        ]).prop_map(|text| text.as_bytes().to_vec()),
        1 => Just(b"{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":{\"data\":[1.5,-2,\"}\\\"\"]}}\n".to_vec()),
        1 => (100_usize..150).prop_map(|levels| nested(levels).into_bytes()),
        1 => (100_usize..150).prop_map(|levels| "[".repeat(levels).into_bytes()),
        1 => (100_usize..150).prop_map(|levels| "]".repeat(levels).into_bytes()),
        1 => any::<u8>().prop_map(|byte| vec![byte]),
    ];
    proptest::collection::vec(bits, 0..60).prop_map(|bits| bits.concat())
}

/// Cuts a stream at the given places, as far as they lie within it.
fn cut<'a>(stream: &'a [u8], cuts: &[prop::sample::Index]) -> Vec<&'a [u8]> {
    let mut ends: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
    ends.push(stream.len());
    ends.sort_unstable();
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts
        .zip(&ends)
        .map(|(start, &end)| &stream[start..end])
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_split_gives_the_same_frames(
        stream in stream(),
        cuts in proptest::collection::vec(any::<prop::sample::Index>(), 0..12),
    ) {
        prop_assert_eq!(read(cut(&stream, &cuts)), read([&stream[..]]));
    }

    #[test]
    fn any_split_gives_the_same_frames_of_messages(
        stream in stream(),
        cuts in proptest::collection::vec(any::<prop::sample::Index>(), 0..12),
    ) {
        let messages = |pieces: Vec<&[u8]>| {
            let mut reader = FrameReader::of_messages();
            let mut found = Vec::new();
            for piece in pieces {
                reader.push(piece);
                found.extend(reader.by_ref());
            }
            (found, reader.finish())
        };
        prop_assert_eq!(messages(cut(&stream, &cuts)), messages(vec![&stream]));
    }

    /// `N` and `I` occur only as random bytes in the streams, so that no text is changed.
    #[test]
    fn the_reader_agrees_with_the_rules_written_slowly(stream in stream()) {
        let outcomes: Vec<_> = outcomes(&stream).iter().map(in_terms_of_the_model).collect();
        prop_assert_eq!(outcomes, model(&stream));
    }

    #[test]
    fn frames_that_were_written_are_read_again(
        values in proptest::collection::vec(any::<(String, f64)>(), 0..8),
        newline in any::<bool>(),
    ) {
        let frames: Vec<String> = values
            .iter()
            .map(|(text, number)| serde_json::json!({"text": text, "number": [number]}).to_string())
            .collect();
        let stream = frames.join(if newline { "\n" } else { "" });
        let read: Vec<String> = outcomes(stream.as_bytes()).into_iter().map(Result::unwrap).collect();
        prop_assert_eq!(read, frames);
    }

    #[test]
    fn no_bytes_make_the_reader_panic(
        pieces in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..80), 0..8),
    ) {
        read(pieces.iter().map(Vec::as_slice));
        let _ = opening(&pieces.concat());
    }
}
