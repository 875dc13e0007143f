//! Lines on standard error.
//!
//! **Invariant:** a closed standard error has no effect on the program.

use std::io::Write;

/// Prints a line.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "pendularm-ros2: {line}");
}

/// Prints a line, unless it is the same as the last one, so a failure that repeats every second is printed once.
#[derive(Debug, Default)]
pub struct Repeated(String);

impl Repeated {
    /// Prints it, if it is new.
    pub fn say(&mut self, line: String) {
        if self.0 != line {
            say(&line);
            self.0 = line;
        }
    }

    /// Prints the next line in any case.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}
