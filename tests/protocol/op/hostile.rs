//! Hostile frames: long, deep or arbitrary ones.

use pendularm::protocol::op::{Op, read};
use proptest::prelude::*;

use super::{op, problem};

#[test]
fn client_text_in_a_message_is_short_and_without_control_characters() {
    let long = "x".repeat(1_000_000);
    for frame in [
        format!(r#"{{"op":"{long}"}}"#),
        format!(r#"{{"op":"\u001b\n{long}"}}"#),
        format!(r#"{{"op":"publish","topic":"/x","msg":"{long}"}}"#),
        format!(r#"{{"op":"publish","topic":{}}}"#, "9".repeat(1_000_000)),
        format!(r#""{long}""#),
        "{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":\"\u{7f}\u{9b}\"}".to_owned(),
    ] {
        let message = problem(&frame);
        assert!(message.chars().count() < 250, "{message}");
        assert!(!message.chars().any(char::is_control), "{message}");
    }
}

/// Payloads are skipped, not parsed, so their depth needs no stack.
#[test]
fn deep_payloads_are_no_danger() {
    let deep = "[".repeat(100_000) + &"]".repeat(100_000);
    let frame = format!(r#"{{"op":"publish","topic":"/x","msg":{{"a":{deep}}}}}"#);
    assert!(matches!(op(&frame), Op::Publish { .. }));
}

proptest! {
    #[test]
    fn no_frame_makes_the_reader_panic(text in any::<String>()) {
        let _ = read(&text);
    }
}
