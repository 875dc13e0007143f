//! Bytes into frames.
//!
//! **Invariant:** whatever is checked of a stream is checked of every way to cut it up.

use pendularm::protocol::limits::{MAX_FRAME, MAX_NESTING};
use pendularm::protocol::wire::frame::{Foreign, Frame, FrameError, FrameReader, Opening, opening};
use proptest::prelude::*;

type Outcome = Result<String, FrameError>;

/// All outcomes of a stream that comes in these pieces.
fn read<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Vec<Outcome> {
    let mut reader = FrameReader::new();
    let mut outcomes = Vec::new();
    for piece in pieces {
        reader.push(piece);
        outcomes.extend(reader.by_ref().map(|found| found.map(|frame| frame.text)));
    }
    outcomes.extend(reader.finish().map(Err));
    outcomes
}

/// The outcomes of a stream that comes at once, which have to be those of the same stream byte by byte.
fn outcomes(stream: &[u8]) -> Vec<Outcome> {
    let whole = read([stream]);
    assert_eq!(read(stream.chunks(1)), whole, "cut into single bytes");
    whole
}

fn frame(text: &str) -> Outcome {
    Ok(text.to_owned())
}

fn first_frame(stream: &str) -> Frame {
    let mut reader = FrameReader::new();
    reader.push(stream.as_bytes());
    reader.next().expect("an outcome").expect("a frame")
}

fn nested(levels: usize) -> String {
    let inner = levels - 1;
    format!("{{\"a\":{}{}}}", "[".repeat(inner), "]".repeat(inner))
}

#[test]
fn a_frame_ends_with_its_line() {
    assert_eq!(outcomes(b"{\"a\":1}\n"), [frame("{\"a\":1}")]);
}

#[test]
fn carriage_returns_and_blank_lines_are_nothing() {
    let stream = b"\r\n\n \t\r\n{\"a\":1}\r\n\r\n\n{\"b\":2}\r\n";
    assert_eq!(outcomes(stream), [frame("{\"a\":1}"), frame("{\"b\":2}")]);
}

#[test]
fn a_complete_object_needs_no_newline() {
    assert_eq!(
        outcomes(b"{\"a\":{\"b\":[]}}"),
        [frame("{\"a\":{\"b\":[]}}")]
    );
}

#[test]
fn many_frames_come_in_one_piece() {
    assert_eq!(
        outcomes(b"{}{\"a\":1} {}\n{}"),
        [frame("{}"), frame("{\"a\":1}"), frame("{}"), frame("{}")]
    );
}

#[test]
fn brackets_inside_strings_do_not_count() {
    let text = r#"{"a":"}]{[\"}\\"}"#;
    assert_eq!(outcomes(text.as_bytes()), [frame(text)]);
}

#[test]
fn later_frames_work_after_a_malformed_one() {
    assert_eq!(
        outcomes(b"{\"a\":1\n{\"b\":2}\n"),
        [Err(FrameError::LineEnded), frame("{\"b\":2}")]
    );
}

#[test]
fn a_newline_inside_a_string_ends_the_frame_too() {
    assert_eq!(
        outcomes(b"{\"a\":\"x\n{\"b\":2}\n"),
        [Err(FrameError::LineEndedInString), frame("{\"b\":2}")]
    );
    assert_eq!(
        outcomes(b"{\"a\":\"x\\\n{}"),
        [Err(FrameError::LineEndedInString), frame("{}")]
    );
}

#[test]
fn what_is_no_object_runs_to_the_newline_and_nothing_inside_it_counts() {
    for line in [
        "hello {\"op\":\"x\"} there",
        "[{\"op\":\"x\"}]",
        "\"{}\"",
        "}{}",
        "\u{feff}{}",
        "1",
    ] {
        let stream = format!("{line}\n{{\"b\":2}}\n");
        let outcomes = outcomes(stream.as_bytes());
        assert_eq!(outcomes.len(), 2, "{line}: {outcomes:?}");
        assert!(
            matches!(&outcomes[0], Err(FrameError::NotAnObject(_))),
            "{line}: {outcomes:?}"
        );
        assert_eq!(outcomes[1], frame("{\"b\":2}"));
    }
}

#[test]
fn a_line_that_is_no_object_is_quoted_in_part_with_its_control_characters_escaped() {
    let [Err(error)] = &outcomes(b"\x1b[31mred\n")[..] else {
        panic!("one error")
    };
    let text = error.to_string();
    assert!(text.contains("\\u{1b}[31mred"), "{text}");
    let long = vec![b'x'; 1_000_000];
    let [Err(error)] = &read([&long[..]])[..] else {
        panic!("one error")
    };
    assert!(error.to_string().len() < 150, "{error}");
}

#[test]
fn a_line_that_is_no_object_is_answered_before_it_ends() {
    let mut reader = FrameReader::new();
    reader.push(&[b'x'; 100]);
    assert!(matches!(
        reader.next(),
        Some(Err(FrameError::NotAnObject(_)))
    ));
    reader.push(b"{}{}\n{}");
    assert_eq!(
        reader.next().map(|found| found.map(|frame| frame.text)),
        Some(frame("{}"))
    );
    assert_eq!(reader.next(), None);
}

#[test]
fn a_bracket_that_closes_another_kind_spoils_the_line_and_nothing_inside_it_counts() {
    for (line, opener, found) in [
        ("{\"a\":]{\"op\":\"x\"}}", '{', ']'),
        ("{\"a\":[1}]} {\"op\":\"x\"}", '[', '}'),
        ("{\"a\":[{]}]}", '{', ']'),
    ] {
        let stream = format!("{line}\n{{}}\n");
        let mismatch = FrameError::Mismatch { opener, found };
        assert_eq!(
            outcomes(stream.as_bytes()),
            [Err(mismatch), frame("{}")],
            "{line}"
        );
    }
}

#[test]
fn the_end_of_the_stream_inside_a_frame_is_one_malformed_frame() {
    assert_eq!(
        outcomes(b"{}\n{\"a\":1"),
        [frame("{}"), Err(FrameError::StreamEnded)]
    );
    assert!(matches!(
        &outcomes(b"hello")[..],
        [Err(FrameError::NotAnObject(_))]
    ));
    assert_eq!(outcomes(b"{}\n  "), [frame("{}")]);
}

#[test]
fn bytes_that_are_not_utf_8_spoil_only_their_frame() {
    assert_eq!(
        outcomes(b"{\"a\":\"\xff\"}\n{\"b\":\"\xc3\xa9\"}\n"),
        [Err(FrameError::NotUtf8 { at: 6 }), frame("{\"b\":\"é\"}")]
    );
}

#[test]
fn a_frame_of_exactly_the_limit_is_taken() {
    let text = format!("{{\"a\":\"{}\"}}", "x".repeat(MAX_FRAME - 8));
    assert_eq!(text.len(), MAX_FRAME);
    let stream = format!("{text}\n{{}}\n");
    // No `assert_eq!`: it would print megabytes.
    assert!(read([stream.as_bytes()]) == [frame(&text), frame("{}")]);
    assert!(read(stream.as_bytes().chunks(4093)) == [frame(&text), frame("{}")]);
}

/// Frames one byte and a lot beyond the limit, ended by their brackets or by a newline, whole and in pieces; also one with
/// brackets and a newline's escape in the part that is skipped, and one in which something else goes wrong behind the limit.
#[test]
fn a_longer_frame_gets_one_error_and_is_skipped_to_where_it_would_have_ended() {
    let filler = |length: usize| "x".repeat(length);
    let over = MAX_FRAME - 5;
    for text in [
        format!("{{\"a\":\"{}\"}}", filler(MAX_FRAME - 7)),
        format!("{{\"a\":\"{}\"}}", filler(2 * over)),
        format!("{{\"a\":\"{}\",\"b\":[\"]}}\\\"\\n\",{{}}]}}", filler(over)),
        format!("{{\"a\":\"{}\n", filler(over)),
        format!("{{\"a\":\"{}\"]}}}}{{}}\n", filler(over)),
        format!(
            "{{\"a\":\"{}\",\"b\":{}\n",
            filler(over),
            nested(MAX_NESTING + 9)
        ),
    ] {
        let stream = text + "{\"b\":2}";
        let expected = [Err(FrameError::TooLong(MAX_FRAME)), frame("{\"b\":2}")];
        assert_eq!(read([stream.as_bytes()]), expected);
        for size in [64 * 1024, 999_983] {
            assert_eq!(
                read(stream.as_bytes().chunks(size)),
                expected,
                "pieces of {size}"
            );
        }
    }
}

#[test]
fn a_frame_that_is_too_long_is_reported_before_it_ends_and_is_not_kept() {
    let mut reader = FrameReader::new();
    let chunk = [b' '; 64 * 1024];
    reader.push(b"{");
    let mut errors = 0;
    for _ in 0..200 {
        reader.push(&chunk);
        errors += reader
            .by_ref()
            .filter(|found| *found == Err(FrameError::TooLong(MAX_FRAME)))
            .count();
    }
    assert_eq!(errors, 1);
    assert!(
        reader.buffered() <= chunk.len(),
        "{} bytes kept",
        reader.buffered()
    );
    assert_eq!(reader.finish(), None);
}

#[test]
fn an_idle_reader_gives_back_the_memory_of_a_long_frame() {
    let mut reader = FrameReader::new();
    let text = format!("{{\"a\":\"{}\"}}\n", "x".repeat(1_000_000));
    reader.push(text.as_bytes());
    assert_eq!(reader.by_ref().count(), 1);
    assert!(reader.buffered() < 64 * 1024);
    // Room for usual frames stays, so that they are read without allocating.
    assert!(reader.buffered() >= 16 * 1024);
}

#[test]
fn what_is_buffered_is_what_has_come_of_an_unfinished_frame() {
    let mut reader = FrameReader::new();
    let half = format!("{{\"a\":\"{}", "x".repeat(100_000));
    reader.push(half.as_bytes());
    assert_eq!(reader.next(), None);
    assert!(reader.buffered() >= half.len());
}

/// The reader never is at the end of a frame when it is at the end of what was pushed.
#[test]
fn frames_that_are_done_with_are_not_kept_though_one_is_always_unfinished() {
    let mut reader = FrameReader::new();
    let text = format!("{{\"a\":\"{}\"}}\n", "x".repeat(1000));
    let (front, back) = text.split_at(10);
    let chunk = format!("{back}{}{front}", text.repeat(9));
    reader.push(front.as_bytes());
    for _ in 0..100 {
        assert_eq!(reader.next(), None);
        reader.push(chunk.as_bytes());
        assert_eq!(reader.by_ref().filter(Result::is_ok).count(), 10);
        // The unfinished bytes and those pushed last, twice, and the reserve of a growing buffer.
        assert!(reader.buffered() < 5 * chunk.len());
    }
}

/// 32 bytes are enough to recognise a line by; a sender that never ends it hears of it then.
#[test]
fn the_beginning_of_a_line_that_is_no_object_is_told_as_soon_as_32_bytes_are_there() {
    let mut reader = FrameReader::new();
    reader.push(&[b'x'; 31]);
    assert_eq!(reader.next(), None);
    reader.push(b"y");
    let told = reader.next().expect("an error").unwrap_err();
    assert!(
        told.to_string()
            .ends_with("got \"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxy…\""),
        "{told}"
    );
    reader.push(b"the rest of it\nshort\n");
    let told = reader.next().expect("an error").unwrap_err();
    assert!(told.to_string().ends_with("got \"short\""), "{told}");
    assert_eq!(reader.next(), None);
}

#[test]
fn nesting_up_to_the_limit_is_taken_and_one_deeper_is_malformed() {
    let (deepest, deeper) = (nested(MAX_NESTING), nested(MAX_NESTING + 1));
    assert_eq!(outcomes(deepest.as_bytes()), [frame(&deepest)]);
    assert_eq!(
        outcomes((deeper + "{}").as_bytes()),
        [Err(FrameError::TooDeep), frame("{}")]
    );
}

#[test]
fn nesting_without_bound_is_one_malformed_frame() {
    let stream = nested(1_000_000) + "{\"b\":2}\n";
    assert_eq!(
        read([stream.as_bytes()]),
        [Err(FrameError::TooDeep), frame("{\"b\":2}")]
    );
    let open = "{\"a\":".repeat(500_000) + "\n{\"b\":2}\n";
    assert_eq!(
        read([open.as_bytes()]),
        [Err(FrameError::TooDeep), frame("{\"b\":2}")]
    );
}

#[test]
fn names_of_non_finite_numbers_become_literals_that_overflow() {
    assert_eq!(
        outcomes(br#"{"a":[NaN,-Infinity],"b":"NaN"}"#),
        [frame(r#"{"a":[9e999,-1e999],"b":"NaN"}"#)]
    );
}

#[test]
fn a_frame_says_whether_a_line_end_was_seen_behind_it() {
    assert!(first_frame("{}\n").newline);
    assert!(first_frame("{}\r\n{}").newline);
    assert!(!first_frame("{}").newline);
    assert!(!first_frame("{}{}\n").newline);
    assert!(!first_frame("{} ").newline);
}

#[test]
fn the_reader_gives_one_frame_at_a_time() {
    let mut reader = FrameReader::new();
    reader.push(b"{\"a\":1}{\"b\":2}");
    assert_eq!(
        reader.next().map(|found| found.map(|frame| frame.text)),
        Some(frame("{\"a\":1}"))
    );
    reader.push(b"{\"c\":3}");
    assert_eq!(
        reader.next().map(|found| found.map(|frame| frame.text)),
        Some(frame("{\"b\":2}"))
    );
    assert_eq!(
        reader.next().map(|found| found.map(|frame| frame.text)),
        Some(frame("{\"c\":3}"))
    );
    assert_eq!(reader.next(), None);
}

#[test]
fn http_requests_are_recognised_as_soon_as_they_can_be() {
    for method in [
        "GET", "HEAD", "POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH", "PRI",
    ] {
        let request = format!("{method} / HTTP/1.1\r\nHost: x\r\n\r\n{{\"op\":\"x\"}}");
        assert_eq!(
            opening(request.as_bytes()),
            Opening::Foreign(Foreign::Http),
            "{method}"
        );
        for length in 0..=method.len() {
            let prefix = &request.as_bytes()[..length];
            assert_eq!(
                opening(prefix),
                Opening::Undecided,
                "{length} bytes of {method}"
            );
        }
        let known = &request.as_bytes()[..=method.len()];
        assert_eq!(opening(known), Opening::Foreign(Foreign::Http), "{method}");
    }
}

#[test]
fn a_tls_hello_is_recognised() {
    assert_eq!(opening(&[0x16]), Opening::Undecided);
    assert_eq!(opening(&[0x16, 0x03]), Opening::Foreign(Foreign::Tls));
    assert_eq!(
        opening(&[0x16, 0x03, 0x01, 0x00, 0xf5]),
        Opening::Foreign(Foreign::Tls)
    );
    assert_eq!(opening(&[0x16, 0x04, 0x01, 0x01]), Opening::Json);
}

#[test]
fn a_nul_among_the_first_four_bytes_is_bson() {
    for length in 1..=4_usize {
        let mut bytes = vec![b'{'; length];
        bytes[length - 1] = 0;
        assert_eq!(
            opening(&bytes),
            Opening::Foreign(Foreign::Bson),
            "{bytes:?}"
        );
    }
    assert_eq!(opening(b"{\"a\"\0"), Opening::Json);
}

#[test]
fn json_is_known_with_its_fourth_byte_or_its_first_line() {
    for bytes in ["", "{", "{\"", "{\"o", "{}", "\n\n\n", "GE", "G"] {
        assert_eq!(opening(bytes.as_bytes()), Opening::Undecided, "{bytes:?}");
    }
    for bytes in [
        "{\"op",
        "{}\n",
        "x\n",
        "\nx\n",
        "{}\r\n",
        "    ",
        "GETS",
        "GET\n",
        "get / HTTP/1.1",
    ] {
        assert_eq!(opening(bytes.as_bytes()), Opening::Json, "{bytes:?}");
    }
}

#[test]
fn every_foreign_protocol_is_named_in_one_line() {
    for (foreign, name) in [
        (Foreign::Http, "HTTP"),
        (Foreign::Tls, "TLS"),
        (Foreign::Bson, "BSON"),
    ] {
        let line = foreign.explanation();
        assert!(
            line.contains(name) && line.contains("JSON") && !line.contains('\n'),
            "{line}"
        );
    }
}

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

/// Where a line is a message, it holds one object or none of it is a frame; so it is with the next.
#[test]
fn a_message_holds_one_object() {
    let mut reader = FrameReader::of_messages();
    for (message, objects) in [
        ("{\"a\":1}", 1),
        (" {\"a\":1} \r\t", 1),
        ("{\"a\":1}{\"a\":1}", 0),
        (
            "{\"a\":1} {\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}",
            0,
        ),
        ("{\"a\":1},", 0),
        ("{\"a\":1}\u{0}", 0),
        ("", 0),
        ("{}", 1),
    ] {
        reader.push(format!("{message}\n").as_bytes());
        let found: Vec<_> = reader.by_ref().collect();
        let frames = found.iter().filter(|frame| frame.is_ok()).count();
        assert_eq!(frames, objects, "{message:?}: {found:?}");
        let is_silent = message.is_empty();
        assert_eq!(
            found.len(),
            usize::from(!is_silent),
            "{message:?}: {found:?}"
        );
    }
}

/// A message is read as it comes: what stands behind its object, however late that comes, makes it none.
#[test]
fn what_is_behind_the_object_of_a_message_may_come_late() {
    let mut reader = FrameReader::of_messages();
    for (pieces, objects) in [
        (["{\"a\":1}", " \t", "\r\n"], 1),
        (["{\"a\":1}", " ", "{}\n"], 0),
        (["{\"a\":1}", ",", "{}\n"], 0),
        (["{\"a\":1", "} ", "x\n"], 0),
    ] {
        let mut found = Vec::new();
        for piece in pieces {
            assert_eq!(found, [], "{pieces:?}: before it has ended");
            reader.push(piece.as_bytes());
            found.extend(reader.by_ref());
            let has_ended = piece.ends_with('\n') || !found.is_empty();
            assert_eq!(reader.is_unfinished(), !piece.ends_with('\n'), "{piece:?}");
            if has_ended {
                break;
            }
        }
        reader.push(b"\n");
        assert_eq!(reader.next(), None);
        assert!(!reader.is_unfinished());
        let frames = found.iter().filter(|frame| frame.is_ok()).count();
        assert_eq!((found.len(), frames), (1, objects), "{pieces:?}: {found:?}");
    }
}

/// One error is all that comes of a message.
#[test]
fn nothing_is_done_of_a_message_whose_first_object_is_refused() {
    let too_deep = nested(MAX_NESTING + 1);
    let mut reader = FrameReader::of_messages();
    for refused in ["]", "{]", &too_deep] {
        reader.push(format!("{refused} {{\"a\":1}}\n{{}}\n").as_bytes());
        let found: Vec<_> = reader.by_ref().collect();
        assert!(
            matches!(&found[..], [Err(_), Ok(frame)] if frame.text == "{}"),
            "{found:?}"
        );
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
