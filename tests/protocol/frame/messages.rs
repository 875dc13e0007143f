//! Lines that are messages, as on WebSocket: each holds one object.

use pendularm::protocol::limits::MAX_NESTING;
use pendularm::protocol::wire::frame::FrameReader;

use super::nested;

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

/// A message is read as it comes: bytes behind its object, however late they come, make it none.
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
