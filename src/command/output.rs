//! Standard output and standard error, either of which may be closed.
//!
//! **Invariant:** a reader that goes away ends the command quietly.

use std::io::{self, Write};

use super::error::{CommandError, plain};
use crate::output;

/// Prints to standard output, at once.
///
/// # Errors
/// [`CommandError::Closed`] if nobody reads it any more, or the system's word.
pub(super) fn print(text: &str) -> Result<(), CommandError> {
    match output::print(text) {
        Ok(true) => Ok(()),
        Ok(false) => Err(CommandError::Closed),
        Err(why) => Err(CommandError::System {
            what: "standard output",
            why,
        }),
    }
}

/// A line on standard error. If that is broken there is nobody left to tell.
pub(super) fn hint(text: &str) {
    let _ = writeln!(io::stderr(), "pendularm: {}", plain(text));
}
