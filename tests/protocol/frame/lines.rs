//! Frames in lines: their beginning and end, and the effect of a malformed one.

use pendularm::protocol::wire::frame::FrameReader;

use super::{Outcome, outcomes, read};

/// An outcome in the spelling of the table: the frame's text, or the error's name.
fn spelled(outcome: &Outcome) -> String {
    match outcome {
        Ok(text) => text.clone(),
        Err(error) => {
            let name = format!("{error:?}");
            name.split(['(', ' ']).next().unwrap().to_owned()
        }
    }
}

/// A row: its name, a stream, and the outcomes, each a frame or the name of an error. In a stream, `\n`, `\r`, `\t`,
/// `\\` and `\xff` are one byte.
const STREAMS: &str = include_str!("streams.txt");

fn stream_of(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'\\' => match rest.next().unwrap() {
                b'n' => b'\n',
                b'r' => b'\r',
                b't' => b'\t',
                b'x' => {
                    let digits = [rest.next().unwrap(), rest.next().unwrap()];
                    u8::from_str_radix(std::str::from_utf8(&digits).unwrap(), 16).unwrap()
                }
                other => other,
            },
            byte => byte,
        });
    }
    bytes
}

#[test]
fn a_stream_gives_the_frames_and_errors_of_its_row() {
    for row in STREAMS.lines() {
        let [name, stream, expected] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let found: Vec<String> = outcomes(&stream_of(stream)).iter().map(spelled).collect();
        assert_eq!(found.join(" & "), expected, "{name}");
    }
    for silent in ["", " \r\n\t"] {
        assert_eq!(outcomes(silent.as_bytes()), []);
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

/// 32 bytes are enough to recognise a line; a sender that never ends it gets an error then.
#[test]
fn a_line_that_is_no_object_is_reported_after_32_bytes() {
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
fn a_reader_knows_whether_a_line_end_came_after_its_last_frame() {
    for (packets, is_single) in [
        (["{}\n", ""], false),
        (["{}\r\n{", ""], false),
        (["{}", ""], true),
        (["{} ", " \t"], true),
        (["{}", "{}"], true),
        (["{}{}\n", ""], false),
        // The line end may come in a packet of its own.
        (["{}", "\n"], false),
        (["{} ", "\r\n{"], false),
    ] {
        let mut reader = FrameReader::new();
        assert!(!reader.is_single());
        for packet in packets {
            reader.push(packet.as_bytes());
            reader.by_ref().for_each(drop);
        }
        assert_eq!(reader.is_single(), is_single, "{packets:?}");
    }
    let mut reader = FrameReader::new();
    reader.push(b"{}{}\n");
    reader.next();
    assert!(reader.is_single(), "before the second frame");
}
