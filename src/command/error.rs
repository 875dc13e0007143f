//! Why a command was not done, and the exit status for it.
//!
//! **Invariant:** each is one line on which nothing acts on a terminal, whoever its words come from.

use std::io;
use std::time::Duration;

use crate::protocol::wire::text::push_plain;

/// A command that was not done.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The runtime refused, or what was asked for did not succeed.
    #[error("{0}")]
    Refused(String),
    /// An argument is not as it should be.
    #[error("{argument} cannot be read as JSON or YAML: {why}")]
    Unreadable {
        /// The argument.
        argument: &'static str,
        /// The reader's complaint.
        why: String,
    },
    /// Nobody listens there.
    #[error("cannot connect to {address}: {why}")]
    NoConnection {
        /// The address as it was given.
        address: String,
        /// The system's word.
        why: io::Error,
    },
    /// The connection is gone.
    #[error("the connection ended: {0}")]
    Lost(String),
    /// Nothing that was awaited came in time.
    #[error("nothing that was awaited came within {} s", .0.as_secs_f64())]
    Late(Duration),
    /// The system refused what a command needs.
    #[error("{what}: {why}")]
    System {
        /// The need.
        what: &'static str,
        /// The system's word.
        why: io::Error,
    },
    /// The reader of standard output is gone: it has seen what it wanted.
    #[error("standard output is closed")]
    Closed,
}

impl CommandError {
    /// A refusal in somebody else's words.
    pub(super) fn refused(words: &str) -> Self {
        Self::Refused(plain(words))
    }

    /// The exit status.
    #[must_use]
    pub fn status(&self) -> u8 {
        match self {
            Self::Closed => 0,
            Self::Refused(_) | Self::System { .. } => 1,
            Self::Unreadable { .. } => 2,
            Self::NoConnection { .. } | Self::Lost(_) | Self::Late(_) => 3,
        }
    }
}

/// Text as one line on which nothing acts.
pub(super) fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    text.chars().for_each(|one| push_plain(&mut plain, one));
    plain
}
