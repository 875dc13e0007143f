//! Frames of a WebSocket into messages.

use bytes::BytesMut;
use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::wire::frame::{FrameError, FramePart};
use pendularm::protocol::wire::websocket::{self, MessageReader, append_frame};
use pendularm_client::websocket::{LAST, append, append_close, opcode};

/// The outcomes of a stream in these pieces: messages, errors with the start of their message, pings and the end.
fn read<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Vec<String> {
    let mut reader = MessageReader::default();
    let mut outcomes = Vec::new();
    for piece in pieces {
        reader.push(piece);
        while let Some(part) = reader.cut() {
            outcomes.push(match part {
                FramePart::Frame(message) => message.decode().unwrap().unwrap(),
                FramePart::Error(error, start) => format!("{error}: {} bytes", start.len()),
                other => panic!("{other:?}"),
            });
        }
        outcomes.extend(reader.take_ping().map(|ping| format!("ping {ping:?}")));
    }
    outcomes.extend(reader.end().map(|end| format!("{end:?}")));
    outcomes
}

#[test]
fn a_stream_is_read_alike_in_any_pieces() {
    let mask = [1, 2, 3, 4];
    let long = format!("{{\"{}\":1}}", "\u{e9}".repeat(200));
    let mut stream = Vec::new();
    append(&mut stream, LAST | opcode::TEXT, mask, b"{\"whole\":1}");
    append(&mut stream, opcode::BINARY, mask, b"{\"one\":");
    append(&mut stream, opcode::CONTINUATION, mask, b"");
    append(&mut stream, LAST | opcode::PONG, mask, b"pong");
    append(
        &mut stream,
        LAST | opcode::CONTINUATION,
        mask,
        b"\"message\"}",
    );
    append(&mut stream, LAST | opcode::TEXT, mask, long.as_bytes());
    append(&mut stream, LAST | opcode::PING, mask, b"ping");
    append_close(&mut stream, mask, 3000, "why");
    append(&mut stream, LAST | opcode::TEXT, mask, b"after the end");
    let wanted = [
        "{\"whole\":1}",
        "{\"one\":\"message\"}",
        &long,
        "ping b\"ping\"",
        "Closed(Some(3000))",
    ];
    assert_eq!(read([&stream[..]]), wanted);
    for at in 0..stream.len() {
        let (start, end) = stream.split_at(at);
        assert_eq!(read([start, end]), wanted, "cut at {at}");
    }
    assert_eq!(read(stream.chunks(1)), wanted);
}

#[test]
fn a_message_that_is_too_long_is_skipped_to_its_end() {
    let too_long = format!("{}: 1024 bytes", FrameError::TooLong(MAX_FRAME));
    for part in [MAX_FRAME + 1, MAX_FRAME, 1 << 20] {
        let mut stream = Vec::new();
        append(&mut stream, opcode::TEXT, [7; 4], &vec![b'x'; part]);
        for _ in 0..4 {
            append(&mut stream, opcode::CONTINUATION, [7; 4], &vec![b'y'; part]);
        }
        append(&mut stream, LAST | opcode::CONTINUATION, [7; 4], b"");
        append(&mut stream, LAST | opcode::TEXT, [7; 4], b"{}");
        assert_eq!(read(stream.chunks(1 << 15)), [&too_long, "{}"], "{part}");
    }
}

#[test]
fn messages_read_ahead_come_in_order() {
    let mut stream = Vec::new();
    for number in 0..4 {
        let message = format!("{{\"n\":{number}}}");
        append(&mut stream, LAST | opcode::TEXT, [0; 4], message.as_bytes());
    }
    append(&mut stream, LAST | opcode::PING, [0; 4], b"");
    let mut reader = MessageReader::default();
    reader.push(&stream);
    reader.look_ahead(2);
    assert_eq!(reader.take_ping(), None);
    reader.look_ahead(8);
    assert_eq!(
        (reader.waiting(), reader.take_ping()),
        (28, Some("".into()))
    );
    for number in 0..4 {
        let Some(FramePart::Frame(message)) = reader.cut() else {
            panic!("message {number} is missing");
        };
        let message = message.decode().unwrap().unwrap();
        assert_eq!(message, format!("{{\"n\":{number}}}"));
    }
    assert!(reader.cut().is_none() && reader.end().is_none());
}

#[test]
fn frames_of_the_server_have_the_shortest_length_and_no_mask() {
    for (length, head) in [
        (125, &[0x81, 125][..]),
        (126, &[0x81, 126, 0, 126]),
        (65_536, &[0x81, 127, 0, 0, 0, 0, 0, 1, 0, 0]),
    ] {
        let mut frame = BytesMut::new();
        append_frame(
            &mut frame,
            websocket::opcode::TEXT,
            true,
            &vec![b'x'; length],
        );
        assert_eq!(
            (&frame[..head.len()], frame.len()),
            (head, head.len() + length)
        );
    }
}
