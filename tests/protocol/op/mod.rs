//! The operations that clients send.
//!
//! **Invariant:** every bad field is tried in every operation that has it.

mod calls;
mod connection;
mod hostile;
mod later;
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
        other => panic!("{frame}: {other:?}"),
    }
}
