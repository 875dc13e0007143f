//! Runs long computations without the interpreter's lock, in pieces, so that Ctrl-C ends them.
//!
//! **Invariant:** every computation notices a signal within a fraction of a second.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::prelude::{PyResult, Python};
use pyo3::sync::MutexExt;

use crate::floats::Promised;

/// The duration of a piece: short for a user who presses Ctrl-C, and long compared with the check for signals.
const PIECE: Duration = Duration::from_millis(50);

/// Advances a computation, with the interpreter's lock released, until it has a result.
///
/// # Errors
/// Every error that a signal's handler raises, such as `KeyboardInterrupt`.
pub(crate) fn until_done<T: Send>(
    py: Python<'_>,
    mut advance: impl FnMut() -> Option<T> + Send,
) -> PyResult<T> {
    loop {
        let piece = py.detach(|| {
            let _floats = Promised::begin();
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

/// A locked value, in the promised floating-point environment.
#[derive(Debug)]
pub(crate) struct Holding<'a, T> {
    value: MutexGuard<'a, T>,
    _floats: Promised,
}

impl<T> Deref for Holding<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Holding<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

/// Waits for a lock without holding the interpreter's. Its value is consistent, even after a panic of another thread.
pub(crate) fn hold<'a, T>(py: Python<'_>, one: &'a Mutex<T>) -> Holding<'a, T> {
    Holding {
        value: one
            .lock_py_attached(py)
            .unwrap_or_else(PoisonError::into_inner),
        _floats: Promised::begin(),
    }
}

/// A queue of threads that change a shared object: one at a time, in order.
///
/// A signal's handler that runs during its thread's turn shares this turn. Otherwise it would wait for itself.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    /// The thread that has the turn, and the threads that wait.
    line: Mutex<VecDeque<ThreadId>>,
    moved: Condvar,
}

/// A turn, or a place in the queue. It ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Turn<'a> {
    of: &'a Turns,
    thread: ThreadId,
}

impl Turns {
    /// Waits for this thread's turn, with the interpreter's lock released; `None` if the thread has it already.
    ///
    /// # Errors
    /// Every error that a signal's handler raises, such as `KeyboardInterrupt`.
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
        // A handler that ran while its thread waited is later in the queue.
        if let Some(place) = line.iter().rposition(|thread| *thread == self.thread) {
            line.remove(place);
        }
        self.of.moved.notify_all();
    }
}
