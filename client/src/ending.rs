//! The end of a started program.
//!
//! **Invariant:** waiting for a program that does not end returns `None`.

use std::io;
use std::process::{Child, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two checks.
const PAUSE: Duration = Duration::from_millis(5);

/// Waits until a program has ended by itself. Returns its exit status and the elapsed time; `None` if it still
/// runs after `limit`.
///
/// On a stalled machine a check may be late. It then counts for at most ten times its interval.
///
/// # Errors
/// The system's error, if the program's state cannot be read.
pub fn wait(child: &mut Child, limit: Duration) -> io::Result<Option<(ExitStatus, Duration)>> {
    let began = Instant::now();
    let (mut last, mut took) = (began, Duration::ZERO);
    loop {
        let status = child.try_wait()?;
        took += last.elapsed().min(10 * PAUSE);
        if let Some(status) = status {
            return Ok(Some((status, took)));
        }
        if began.elapsed() > limit {
            return Ok(None);
        }
        last = Instant::now();
        thread::sleep(PAUSE);
    }
}
