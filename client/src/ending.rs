//! The end of a program that was started.
//!
//! **Invariant:** whoever waits for one that goes on is told so.

use std::io;
use std::process::{Child, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

/// Between two looks.
const PAUSE: Duration = Duration::from_millis(5);

/// Waits until a program has ended by itself: its exit status, and how long that took. `None` if it goes on after
/// `limit`.
///
/// A machine that stands still wakes nobody: a look that comes late counts for ten times what it should have taken at
/// most.
///
/// # Errors
/// The system's word if it cannot say how the program does.
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
