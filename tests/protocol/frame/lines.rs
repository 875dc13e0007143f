//! Frames in lines: where one begins and ends, and what a malformed one costs.

use pendularm::protocol::wire::frame::{Frame, FrameError, FrameReader};

use super::{frame, outcomes, read};

fn first_frame(stream: &str) -> Frame {
    let mut reader = FrameReader::new();
    reader.push(stream.as_bytes());
    reader.next().expect("an outcome").expect("a frame")
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
