//! Messages of a WebSocket: each holds one object.

use pendularm::protocol::limits::MAX_NESTING;
use pendularm::protocol::op;
use pendularm::protocol::wire::frame::{FrameError, RawFrame};

use super::nested;

/// The text of the frame; `None` if there is only white space.
fn read(message: &str) -> Option<Result<String, FrameError>> {
    let decoded = RawFrame::of_message(message.into()).decode()?;
    Some(decoded.map_err(|(error, start)| {
        assert!(message.trim().as_bytes().starts_with(&start), "{message:?}");
        error
    }))
}

#[test]
fn a_message_holds_one_object_and_may_be_pretty_printed() {
    for (message, text) in [
        ("{}", "{}"),
        (" {\"a\":1} \r\t\n", "{\"a\":1}"),
        ("{\n \"op\":\n\"x\"\r\n}", "{\n \"op\":\n\"x\"\r\n}"),
        ("{\"a\":[NaN,\n\"}\\\"\"]}", "{\"a\":[9e999,\n\"}\\\"\"]}"),
    ] {
        assert_eq!(read(message), Some(Ok(text.to_owned())), "{message:?}");
    }
    for silent in ["", " \r\n\t\n"] {
        assert_eq!(read(silent), None);
    }
}

/// A message with any other content has no effect.
#[test]
fn a_message_that_is_not_one_object_is_refused_as_a_whole() {
    let too_deep = nested(MAX_NESTING + 1);
    let mismatch = FrameError::Mismatch {
        opener: '{',
        found: ']',
    };
    let none = |text: &str| FrameError::NotAnObject(text.to_owned());
    for (message, why) in [
        ("{\"a\":1}{\"a\":1}", FrameError::MoreBehind),
        (
            "{\"a\":1} \n{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{}}",
            FrameError::MoreBehind,
        ),
        ("{\"a\":1},", FrameError::MoreBehind),
        ("{\"a\":1}\u{0}", FrameError::MoreBehind),
        ("{\"a\":1\n", FrameError::LineEnded),
        ("{\"a\":\"\n\"}", FrameError::LineEndedInString),
        ("{\"a\":\"\\\n\"}", FrameError::LineEndedInString),
        ("{]\n{}", mismatch),
        (&format!("{too_deep}\n{{}}"), FrameError::TooDeep),
        ("]\n{}", none("]")),
        (&"x".repeat(99), none(&("x".repeat(32) + "…"))),
    ] {
        assert_eq!(read(message), Some(Err(why)), "{message:?}");
    }
    let not_utf8 = RawFrame::of_message(b"{\"\xff\":1}".to_vec());
    let (error, _) = not_utf8.decode().unwrap().unwrap_err();
    assert_eq!(error, FrameError::NotUtf8 { at: 2 });
}

/// A message for other clients is one line.
#[test]
fn the_payload_of_a_pretty_printed_message_is_one_line() {
    for (space, line) in [("\n", "{ \"a\": 1}"), ("\r\n", "{  \"a\":  1}")] {
        let msg = format!("{{{space}\"a\":{space}1}}");
        let message = format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{msg}}}");
        let text = read(&message).unwrap().unwrap();
        let Ok(op::Op::Publish { msg, .. }) = op::read(&text).op else {
            panic!("it publishes");
        };
        assert_eq!(msg.line(), line);
    }
}
