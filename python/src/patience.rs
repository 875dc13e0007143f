//! Long computations: without the interpreter's lock, and in pieces, so that Ctrl-C ends them.
//!
//! **Invariant:** a signal is heard within a fraction of a second, whatever is computed.

use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How long a piece is: short for who presses Ctrl-C, long beside the time that it takes to look.
const PIECE: Duration = Duration::from_millis(50);

/// Advances a computation, with the interpreter's lock released, until it has an answer.
///
/// # Errors
/// What a signal's handler raises, `KeyboardInterrupt` say.
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
