//! Long computations, and waiting for them: without the interpreter's lock, and in pieces, so that Ctrl-C ends them.
//!
//! **Invariant:** a signal is heard within a fraction of a second, whatever is computed.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::{PyResult, Python};
use pyo3::sync::MutexExt;

/// How long a piece is: short for who presses Ctrl-C, long beside the time that it takes to look.
const PIECE: Duration = Duration::from_millis(50);

/// Advances a computation, with the interpreter's lock released, until it has an answer.
///
/// # Errors
/// Any that a signal's handler raises, such as `KeyboardInterrupt`.
pub(crate) fn until_done<T: Send>(
    py: Python<'_>,
    mut advance: impl FnMut() -> Option<T> + Send,
) -> PyResult<T> {
    loop {
        let piece = py.detach(|| {
            let began = Instant::now();
            loop {
                let answer = advance();
                if answer.is_some() || began.elapsed() >= PIECE {
                    return answer;
                }
            }
        });
        if let Some(answer) = piece {
            return Ok(answer);
        }
        py.check_signals()?;
    }
}

/// Waits for a lock without keeping the interpreter's. What is behind it is whole, also after a panic of another
/// thread.
pub(crate) fn hold<'a, T>(py: Python<'_>, one: &'a Mutex<T>) -> MutexGuard<'a, T> {
    one.lock_py_attached(py)
        .unwrap_or_else(PoisonError::into_inner)
}
