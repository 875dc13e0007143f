//! Standard output of whatever prints and ends.
//!
//! **Invariant:** a reader that goes away is no failure, and output that is lost is one.

use std::io::{self, ErrorKind, Write};

/// Prints to standard output, at once, and answers whether anybody still reads it.
///
/// # Errors
/// The system's word for it, if the text could not be written.
pub fn print(text: &str) -> io::Result<bool> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // A reader that is gone has seen what it wanted: `pendularm --help | head -1`.
        Err(why) if why.kind() == ErrorKind::BrokenPipe => Ok(false),
        written => written.map(|()| true),
    }
}
