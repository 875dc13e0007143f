//! The operations that clients send.
//!
//! **Invariant:** every bad field is tried in every operation that has it.

mod actions;
mod calls;
mod connection;
mod encodings;
mod hostile;
mod long;
mod members;
mod reading;
mod subscribing;

use pendularm::protocol::op::{Op, OpError, read};

fn op(frame: &str) -> Op {
    read(frame)
        .op
        .unwrap_or_else(|error| panic!("{frame}: {error}"))
}

/// The message of an error that is answered by a status.
fn status(frame: &str) -> String {
    match read(frame).op {
        Err(error @ OpError::Status(_)) => error.to_string(),
        Ok(Op::BadAnswer { problem, .. }) => problem.to_string(),
        other => panic!("{frame}: {other:?}"),
    }
}

/// The words about a bad field, however the sender hears of them.
#[track_caller]
fn problem(frame: &str) -> String {
    match read(frame).op {
        Err(OpError::Status(problem) | OpError::Goal { problem, .. }) => problem.to_string(),
        other => panic!("{frame}: {other:?}"),
    }
}
