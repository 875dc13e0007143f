//! The output of a command, and its end.
//!
//! **Invariant:** text of the runtime is printed without terminal control characters. A reader that closes standard
//! output ends the command without an error.

use std::fmt::Display;
use std::io::{self, ErrorKind};

use crate::output;
use crate::protocol::wire::text::shortened;

/// The result of a command or of a part of it.
pub type Outcome<T = ()> = Result<T, CommandError>;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The runtime or the system refused, or the command did not succeed.
    #[error("{0}")]
    Refused(String),
    /// An argument is not valid.
    #[error("{0}")]
    Usage(String),
    /// There is no connection, or no frame arrived in time.
    #[error("{0}")]
    Lost(String),
    /// Standard output cannot be written, or its reader has closed it.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

impl CommandError {
    /// The system refused a thread or a descriptor.
    pub(super) fn system(why: impl Display) -> Self {
        Self::Refused(format!("the system refused: {why}"))
    }

    /// The connection ended, or its frames cannot be read.
    pub(super) fn lost(why: impl Display) -> Self {
        Self::Lost(format!("the connection ended: {why}"))
    }

    /// The exit status.
    #[must_use]
    pub fn status(&self) -> u8 {
        match self {
            Self::Output(why) if why.kind() == ErrorKind::BrokenPipe => 0,
            Self::Refused(_) | Self::Output(_) => 1,
            Self::Usage(_) => 2,
            Self::Lost(_) => 3,
        }
    }
}

/// The runtime's answer cannot be read.
impl From<serde_json::Error> for CommandError {
    fn from(why: serde_json::Error) -> Self {
        Self::lost(format_args!("cannot read a frame: {why}"))
    }
}

/// Text as one line without control characters.
pub(super) fn plain(text: &str) -> String {
    shortened(text, usize::MAX)
}

/// Prints to standard output.
pub(super) fn print(text: &str) -> Outcome {
    Ok(output::print(text)?)
}
