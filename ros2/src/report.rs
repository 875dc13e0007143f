//! Lines on standard error.
//!
//! **Invariant:** nobody has to read it: a standard error that is closed stops nothing.

use std::io::Write;

/// Says a line.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "pendularm-ros2: {line}");
}

/// Says a line unless it was the last one said here: a failure that comes every second is said
/// once.
#[derive(Debug, Default)]
pub struct Repeated(String);

impl Repeated {
    /// Says it, if it is news.
    pub fn say(&mut self, line: String) {
        if self.0 != line {
            say(&line);
            self.0 = line;
        }
    }

    /// The next line is news, even if it was the last one.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}
