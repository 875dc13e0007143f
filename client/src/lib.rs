//! A rosbridge client for programs that test the runtime: tests, fuzz targets, soak and measurements.
//!
//! It shares no code and no frame library with the runtime, so a fault in one is not in the other.
//!
//! | module | what |
//! | --- | --- |
//! | [`codec`] | bytes to messages and back, by line or by WebSocket; no I/O, so that every program here reads frames with it |
//! | [`websocket`] | frames as a client writes them, also in pieces and against the rules |
//! | [`blocking`] | a client on a TCP socket |
//! | [`ending`] | the end of a program that was started |
//! | [`pipe`] | a client on an asynchronous stream (feature `tokio`) |
//!
//! **Invariant:** every wait has a limit, and its error names the awaited event.

pub mod blocking;
pub mod codec;
pub mod ending;
#[cfg(feature = "tokio")]
pub mod pipe;
pub mod websocket;

use std::fmt;
use std::io;

use serde_json::{Value, json};

/// Why a client has no result.
#[derive(Debug)]
pub enum Error {
    /// Nothing arrived before the deadline.
    Late,
    /// The stream has ended.
    Ended,
    /// The runtime sent bytes that no server may send.
    Malformed(String),
    /// The socket has failed.
    Socket(io::Error),
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Late => write!(out, "nothing came in time"),
            Self::Ended => write!(out, "the stream ended"),
            Self::Malformed(what) => write!(out, "malformed: {what}"),
            Self::Socket(error) => write!(out, "the socket failed: {error}"),
        }
    }
}

impl std::error::Error for Error {}

/// A call of a service.
#[must_use]
pub fn call(service: &str, args: &Value, id: &Value) -> Value {
    json!({"op": "call_service", "service": service, "args": args, "id": id})
}

/// Whether `frame` is the response to the call with this id.
#[must_use]
pub fn is_response_to(frame: &Value, id: &Value) -> bool {
    frame["op"] == "service_response" && frame["id"] == *id
}

/// The values of a response that must be successful.
///
/// # Panics
/// If the service has refused.
#[must_use]
#[track_caller]
pub fn values(mut response: Value) -> Value {
    assert_eq!(response["result"], true, "{response}");
    assert_eq!(response["status"], "", "{response}");
    response["values"].take()
}
