//! The operations that clients send.
//!
//! `frames.txt` has a frame in each row, ` its id and its operation => and after ` => ` its id and its operation => `
//! its id and its operation as `Debug` prints it, or its refusal.
//!
//! **Invariant:** every bad field is tried in every operation that has it.

mod hostile;
mod members;

use std::time::Duration;

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::Level;
use pendularm::protocol::op::{
    Compression, Encoding, MAX_QUEUE_LENGTH, MAX_THROTTLE, MAX_TIMEOUT, Op, OpError, Verbosity,
    read,
};
use pendularm::protocol::wire::json::Payload;

const FRAMES: &str = include_str!("frames.txt");

fn op(frame: &str) -> Op {
    read(frame)
        .op
        .unwrap_or_else(|error| panic!("{frame}: {error}"))
}

/// The text about a bad frame, in each form that the sender receives.
#[track_caller]
fn problem(frame: &str) -> String {
    match read(frame).op {
        Err(
            OpError::Status(problem)
            | OpError::Goal { problem, .. }
            | OpError::Call { problem, .. },
        )
        | Ok(Op::BadAnswer { problem, .. }) => problem.to_string(),
        other => panic!("{frame}: {other:?}"),
    }
}

/// A frame's id and operation. Payloads are spelled as their text.
fn spelled(frame: &str) -> String {
    let incoming = read(frame);
    let id = incoming.id.as_ref().map_or("", Payload::get);
    let op = match incoming.op {
        Ok(op) => {
            let op = format!("{op:?}").replace("Payload(Inner { raw: RawValue(", "");
            op.replace("), line: None })", "")
        }
        Err(OpError::Status(problem)) => format!("refused: {problem}"),
        Err(OpError::Call { service, problem }) => format!("call of {service} refused: {problem}"),
        Err(OpError::Goal { action, problem }) => format!("goal of {action} refused: {problem}"),
    };
    format!("{id} {op}").trim_start().to_owned()
}

#[test]
fn every_frame_is_the_operation_or_the_refusal_of_its_row() {
    let rows = FRAMES
        .lines()
        .filter(|row| !row.is_empty() && !row.starts_with('#'));
    let found = |row: &str| {
        let frame = row.split(" => ").next().unwrap();
        format!("{frame} => {}", spelled(frame))
    };
    let other: Vec<String> = rows
        .map(|row| (row, found(row)))
        .filter(|(row, found)| row != found)
        .map(|(_, found)| found)
        .collect();
    assert!(other.is_empty(), "found:\n{}", other.join("\n"));
}

#[test]
fn the_requests_of_a_client_are_bounded() {
    const DAY: u64 = 24 * 3600;
    assert_eq!(MAX_THROTTLE, Duration::from_secs(365 * DAY));
    assert_eq!(MAX_TIMEOUT, Duration::from_secs(DAY));
    assert_eq!(MAX_QUEUE_LENGTH, 100_000);
    let long = format!(r#"{{"op":"auth","token":"{}"}}"#, "s".repeat(MAX_NAME + 1));
    assert!(problem(&long).contains("at most 1024 bytes"));
}

#[test]
fn a_verbosity_includes_its_level_and_more_serious_ones() {
    for (least, wanted) in [
        (Some(Level::Info), [true, true, true]),
        (Some(Level::Warning), [false, true, true]),
        (Some(Level::Error), [false, false, true]),
        (None, [false, false, false]),
    ] {
        let verbosity = Verbosity(least);
        assert_eq!(Level::ALL.map(|level| verbosity.wants(level)), wanted);
    }
}

#[test]
fn of_two_encodings_the_denser_and_the_smaller_pieces_count() {
    let one = |(compression, fragment_size)| Encoding {
        compression,
        fragment_size,
        ros1_stamps: false,
    };
    let (json, cbor, raw) = (Compression::None, Compression::Cbor, Compression::CborRaw);
    for (first, second, both) in [
        ((json, Some(12)), (json, Some(9)), (json, Some(9))),
        ((json, None), (json, Some(9)), (json, Some(9))),
        ((raw, None), (cbor, None), (raw, None)),
        // A binary frame is never fragmented: all its subscribers share it, so a fragment size has no effect.
        ((json, Some(9)), (cbor, Some(5)), (cbor, None)),
    ] {
        assert_eq!(one(first).merged(one(second)), one(both));
        assert_eq!(one(second).merged(one(first)), one(both));
    }
}
