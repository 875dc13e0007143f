//! The output of a command, and its end.
//!
//! **Invariant:** an error is one line without terminal control characters. A reader that closes standard output
//! ends the command without an error.

use std::io::{self, Write};
use std::time::Duration;

use serde_json::value::RawValue;

use crate::protocol::wire::text::push_plain;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The runtime refused, or the command did not succeed.
    #[error("{0}")]
    Refused(String),
    /// An argument is not valid.
    #[error("{0}")]
    Usage(String),
    /// No runtime listens at the address.
    #[error(
        "cannot connect to {0}: {1}; start pendularm there, or name its address with --connect"
    )]
    NoConnection(String, io::Error),
    /// The connection ended.
    #[error("the connection ended: {0}")]
    Lost(String),
    /// No awaited frame arrived in time.
    #[error("no answer or message within {} s", .0.as_secs_f64())]
    Late(Duration),
    /// The system refused a thread or a descriptor.
    #[error("the system refused: {0}")]
    System(#[from] io::Error),
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Output(io::Error),
    /// The reader has closed standard output.
    #[error("standard output is closed")]
    Closed,
}

impl CommandError {
    /// A refusal with the text of the runtime or of another client.
    pub(super) fn refused(words: &str) -> Self {
        Self::Refused(plain(words))
    }

    pub(super) fn output(why: io::Error) -> Self {
        match why.kind() {
            io::ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Output(why),
        }
    }

    /// The exit status.
    #[must_use]
    pub fn status(&self) -> u8 {
        match self {
            Self::Closed => 0,
            Self::Refused(_) | Self::System(_) | Self::Output(_) => 1,
            Self::Usage(_) => 2,
            Self::NoConnection(..) | Self::Lost(_) | Self::Late(_) => 3,
        }
    }
}

/// Text as one line without control characters.
pub(super) fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    text.chars().for_each(|one| push_plain(&mut plain, one));
    plain
}

/// Prints to standard output without buffering.
pub(super) fn print(text: &str) -> Result<(), CommandError> {
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(CommandError::output)
}

/// JSON that is built from JSON.
pub(super) fn raw(text: String) -> Result<Box<RawValue>, CommandError> {
    RawValue::from_string(text).map_err(|error| CommandError::Lost(error.to_string()))
}
