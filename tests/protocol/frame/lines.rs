//! Frames in lines: where one begins and ends, and what a malformed one costs.

use pendularm::protocol::wire::frame::{Frame, FrameReader};

use super::{Outcome, outcomes, read};

fn first_frame(stream: &str) -> Frame {
    let mut reader = FrameReader::new();
    reader.push(stream.as_bytes());
    reader.next().expect("an outcome").expect("a frame")
}

/// An outcome as the table spells it: the frame's text, or the error's name.
fn spelled(outcome: &Outcome) -> String {
    match outcome {
        Ok(text) => text.clone(),
        Err(error) => {
            let name = format!("{error:?}");
            name.split(['(', ' ']).next().unwrap().to_owned()
        }
    }
}

/// The name of a row, its stream, and the outcomes.
type Row = (&'static str, &'static [u8], &'static [&'static str]);

const STREAMS: [Row; 26] = [
    ("a line", b"{\"a\":1}\n", &["{\"a\":1}"]),
    (
        "blank lines",
        b"\r\n\n \t\r\n{}\r\n\r\n\n{\"b\":2}\r\n",
        &["{}", "{\"b\":2}"],
    ),
    ("no newline", b"{\"a\":{\"b\":[]}}", &["{\"a\":{\"b\":[]}}"]),
    (
        "one behind another",
        b"{}{\"a\":1} {}\n{}",
        &["{}", "{\"a\":1}", "{}", "{}"],
    ),
    (
        "brackets in strings",
        br#"{"a":"}]{[\"}\\"}"#,
        &[r#"{"a":"}]{[\"}\\"}"#],
    ),
    (
        "after a malformed one",
        b"{\"a\":1\n{}\n",
        &["LineEnded", "{}"],
    ),
    (
        "newline in a string",
        b"{\"a\":\"x\n{}\n",
        &["LineEndedInString", "{}"],
    ),
    (
        "escape at the end",
        b"{\"a\":\"x\\\n{}",
        &["LineEndedInString", "{}"],
    ),
    (
        "not an object: text",
        b"hello {\"op\":\"x\"} there\n{}\n",
        &["NotAnObject", "{}"],
    ),
    (
        "not an object: array",
        b"[{\"op\":\"x\"}]\n{}\n",
        &["NotAnObject", "{}"],
    ),
    (
        "not an object: string",
        b"\"{}\"\n{}\n",
        &["NotAnObject", "{}"],
    ),
    (
        "not an object: bracket",
        b"}{}\n{}\n",
        &["NotAnObject", "{}"],
    ),
    (
        "not an object: mark",
        "\u{feff}{}\n{}\n".as_bytes(),
        &["NotAnObject", "{}"],
    ),
    ("not an object: number", b"1\n{}\n", &["NotAnObject", "{}"]),
    (
        "] closes {",
        b"{\"a\":]{\"op\":\"x\"}}\n{}\n",
        &["Mismatch", "{}"],
    ),
    (
        "} closes [",
        b"{\"a\":[1}]} {\"op\":\"x\"}\n{}\n",
        &["Mismatch", "{}"],
    ),
    ("deeper", b"{\"a\":[{]}]}\n{}\n", &["Mismatch", "{}"]),
    (
        "stream ends in a frame",
        b"{}\n{\"a\":1",
        &["{}", "StreamEnded"],
    ),
    ("stream ends in text", b"hello", &["NotAnObject"]),
    ("stream ends in space", b"{}\n  ", &["{}"]),
    (
        "not UTF-8",
        b"{\"a\":\"\xff\"}\n{\"b\":\"\xc3\xa9\"}\n",
        &["NotUtf8", "{\"b\":\"é\"}"],
    ),
    (
        "NaN",
        br#"{"a":[NaN,-Infinity],"b":"NaN"}"#,
        &[r#"{"a":[9e999,-1e999],"b":"NaN"}"#],
    ),
    ("NaN in a name", br#"{"NaN":1}"#, &[r#"{"NaN":1}"#]),
    ("empty", b"", &[]),
    ("space alone", b" \r\n\t", &[]),
    ("comma between", b"{},{}\n{}", &["{}", "NotAnObject", "{}"]),
];

#[test]
fn a_stream_gives_the_frames_and_errors_of_its_row() {
    for (name, stream, expected) in STREAMS {
        let found: Vec<String> = outcomes(stream).iter().map(spelled).collect();
        assert_eq!(found, expected, "{name}");
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
fn a_frame_says_whether_a_line_end_was_seen_behind_it() {
    assert!(first_frame("{}\n").newline);
    assert!(first_frame("{}\r\n{}").newline);
    assert!(!first_frame("{}").newline);
    assert!(!first_frame("{}{}\n").newline);
    assert!(!first_frame("{} ").newline);
}
