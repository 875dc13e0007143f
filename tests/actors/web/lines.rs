//! WebSocket messages as lines.

use bytes::{Bytes, BytesMut};
use pendularm::protocol::op;
use pendularm::protocol::wire::frame::FrameReader;
use pendularm::web::message::OneLine;

fn line(message: &str) -> String {
    let mut stream = BytesMut::new();
    let mut line = OneLine::new(Bytes::copy_from_slice(message.as_bytes()));
    assert!(line.append(usize::MAX, &mut stream));
    String::from_utf8(stream.to_vec()).unwrap()
}

#[test]
fn a_message_in_pieces_is_the_same_line() {
    for message in [
        "{\n \"op\":\n\"x\"\r\n}",
        r#"{"a":"\"\\"}"#,
        "{\"a\":\"\\\\\\\"\n\\\n\"\n,\"b\\\"\":\n[\"\",\n\"\n\"]}",
        &"{\"numbers, many of them\":[1,\n2]}".repeat(9),
        "",
    ] {
        let whole = line(message);
        for most in 1..whole.len() + 2 {
            let mut stream = BytesMut::new();
            let mut line = OneLine::new(Bytes::copy_from_slice(message.as_bytes()));
            let mut pieces = 1;
            loop {
                let before = stream.len();
                let is_last = line.append(most, &mut stream);
                assert!((1..=most).contains(&(stream.len() - before)));
                if is_last {
                    break;
                }
                pieces += 1;
            }
            assert_eq!(stream, whole.as_bytes(), "{most} bytes at a time");
            assert_eq!(pieces, whole.len().div_ceil(most));
        }
    }
}

#[test]
fn line_ends_between_tokens_become_spaces() {
    assert_eq!(line("{\n \"op\":\n\"x\"\r\n}"), "{  \"op\": \"x\"\r }\n");
    assert_eq!(line("{}"), "{}\n");
    assert_eq!(line(""), "\n");
    assert_eq!(line(r#"{"a":"\"\\"}"#), "{\"a\":\"\\\"\\\\\"}\n");
}

#[test]
fn a_line_end_within_a_string_does_not_become_valid() {
    for message in [
        "{\"op\":\"subscribe\",\"topic\":\"/a\n\"}",
        "{\"op\":\"subscribe\",\"topic\":\"\\\"/a\n{\\\"op\\\":1}\"}",
        "{\"op\":\"subscribe\",\"topic\":\"/a\\\n\"}",
    ] {
        let mut frames = FrameReader::new();
        frames.push(line(message).as_bytes());
        let frame = frames.next().unwrap().unwrap();
        assert!(op::read(&frame.text).op.is_err(), "{message:?}");
        assert_eq!(frames.next(), None);
    }
}
