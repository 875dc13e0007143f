//! Standard output and standard error of commands.
//!
//! **Invariant:** a reader that goes away is no failure, and output that is lost is one. A complaint is one line of
//! bounded length, and nothing in it acts on a terminal.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use crate::protocol::wire::text::shortened;

/// Longest complaint \[characters\]: words of a file or of a server are cut there.
const MAX_LINE: usize = 1000;

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

/// Text on one line for a terminal, escaped.
#[must_use]
pub fn line(text: &dyn Display) -> String {
    shortened(&text.to_string(), MAX_LINE)
}

/// Prints one line to standard error. If that is broken there is nobody left to tell.
pub fn complain(error: &dyn Display) {
    let _ = writeln!(io::stderr(), "pendularm: {}", line(error));
}
