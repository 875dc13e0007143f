//! Standard output and standard error, either of which may be closed.
//!
//! **Invariant:** a reader that goes away ends the command quietly.

use std::io::{self, ErrorKind, Write};

use super::error::{CommandError, plain};

/// Prints to standard output, at once.
///
/// # Errors
/// [`CommandError::Closed`] if nobody reads it any more, or the system's word.
pub(super) fn print(text: &str) -> Result<(), CommandError> {
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|why| match why.kind() {
        ErrorKind::BrokenPipe => CommandError::Closed,
        _ => CommandError::System {
            what: "standard output",
            why,
        },
    })
}

/// A line on standard error. If that is broken there is nobody left to tell.
pub(super) fn hint(text: &str) {
    let _ = writeln!(io::stderr(), "pendularm: {}", plain(text));
}
