//! Standard output and standard error of commands.
//!
//! **Invariant:** a reader that closes the pipe is not a failure; lost output is. An error message is one line of
//! bounded length without control characters.

use std::fmt::Display;
use std::io::{self, Write};

use crate::protocol::wire::text::shortened;

/// Longest error message \[characters\]. Texts of files and servers are cut there.
const MAX_LINE: usize = 1000;

/// Prints to standard output without buffering.
///
/// # Errors
/// The system's error, if the text could not be written.
pub fn print(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// Text as one escaped line for a terminal.
#[must_use]
pub fn line(text: &dyn Display) -> String {
    shortened(&text.to_string(), MAX_LINE)
}

/// Prints one line to standard error. An error there cannot be reported.
pub fn print_error(error: &dyn Display) {
    let _ = writeln!(io::stderr(), "pendularm: {}", line(error));
}
