//! Long computations, and waiting for them: without the interpreter's lock, and in pieces, so that Ctrl-C ends them.
//!
//! **Invariant:** every computation notices a signal within a fraction of a second.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
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

/// Waits for a lock without keeping the interpreter's. The value behind it is whole, also after a panic of
/// another thread.
pub(crate) fn hold<'a, T>(py: Python<'_>, one: &'a Mutex<T>) -> MutexGuard<'a, T> {
    one.lock_py_attached(py)
        .unwrap_or_else(PoisonError::into_inner)
}

/// The threads that want to change a thing that they share: one at a time, in the order in which they came.
///
/// A handler of a signal that comes in the middle of its thread's turn has that turn too; it would wait for itself.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    /// The thread whose turn it is, and those that wait.
    line: Mutex<VecDeque<ThreadId>>,
    moved: Condvar,
}

/// A turn, or a place in the line; it ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Turn<'a> {
    of: &'a Turns,
    thread: ThreadId,
}

impl Turns {
    /// Waits until it is this thread's turn, with the interpreter's lock released; `None` where it is already.
    ///
    /// # Errors
    /// Any that a signal's handler raises, such as `KeyboardInterrupt`.
    pub(crate) fn take(&self, py: Python<'_>) -> PyResult<Option<Turn<'_>>> {
        let thread = thread::current().id();
        let mut line = self.line();
        if line.front() == Some(&thread) {
            return Ok(None);
        }
        line.push_back(thread);
        let is_first = line.len() == 1;
        drop(line);
        let turn = Turn { of: self, thread };
        if !is_first {
            until_done(py, || {
                let line = self.line();
                if line.front() == Some(&thread) {
                    return Some(());
                }
                drop(self.moved.wait_timeout(line, PIECE));
                None
            })?;
        }
        Ok(Some(turn))
    }

    fn line(&self) -> MutexGuard<'_, VecDeque<ThreadId>> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut line = self.of.line();
        // A handler that ran while its thread waited came later than that.
        if let Some(place) = line.iter().rposition(|thread| *thread == self.thread) {
            line.remove(place);
        }
        self.of.moved.notify_all();
    }
}
