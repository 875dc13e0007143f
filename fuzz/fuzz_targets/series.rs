//! Messages that are passed on unread against the same stream read frame by frame.
//!
//! Asserted: a series is, message by message and byte for byte, what reading each frame and writing
//! it anew gives; nothing is lost or read twice around it, however the stream is cut.
//!
//! Input: a byte that says in which pieces the rest comes, the rest. A `~` in it stands for how a message begins.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::messages;
use pendularm::protocol::op::{self, Op};
use pendularm::protocol::wire::frame::{Frame, FrameError, FrameReader};
use pendularm::protocol::wire::series::{MAX_SERIES, messages as each};
use pendularm_fuzz::limits::{READING, hold};

const HEAD: &[u8] = b"{\"op\":\"publish\",\"topic\":\"/a\",\"msg\":{";

fuzz_target!(|input: &[u8]| hold(input.len(), READING, || examine(input)));

fn examine(input: &[u8]) {
    let &[piece, ref rest @ ..] = input else {
        return;
    };
    let mut stream = Vec::new();
    for byte in rest {
        match byte {
            b'~' => stream.extend_from_slice(HEAD),
            byte => stream.push(*byte),
        }
    }
    let one_by_one = read(&stream, stream.len().max(1), false);
    assert_eq!(read(&stream, stream.len().max(1), true), one_by_one);
    assert_eq!(read(&stream, usize::from(piece).max(1), true), one_by_one);
}

/// The outcome of a frame: the message as it is passed on, or the frame.
#[derive(Debug, PartialEq, Eq)]
enum Outcome {
    Message(Vec<u8>),
    Other(String),
    Error(FrameError),
}

fn read(stream: &[u8], piece: usize, takes_series: bool) -> Vec<Outcome> {
    let mut reader = FrameReader::new();
    let mut outcomes = Vec::new();
    for piece in stream.chunks(piece) {
        reader.push(piece);
        loop {
            if takes_series && let Some(series) = reader.series() {
                assert!((1..=MAX_SERIES).contains(&series.frames.len()));
                assert!(series.topic.starts_with('/'));
                outcomes.extend(each(series.frames).map(|frame| Outcome::Message(frame.to_vec())));
                continue;
            }
            let Some(next) = reader.next() else {
                break;
            };
            outcomes.push(judge(next));
        }
    }
    outcomes.extend(reader.finish().map(Outcome::Error));
    outcomes
}

fn judge(next: Result<Frame, FrameError>) -> Outcome {
    let frame = match next {
        Ok(frame) => frame.text,
        Err(error) => return Outcome::Error(error),
    };
    let incoming = op::read(&frame);
    match incoming.op {
        Ok(Op::Publish { topic, msg, .. }) => {
            Outcome::Message(messages::publish_raw(&topic, &msg).to_vec())
        }
        _ => Outcome::Other(frame),
    }
}
