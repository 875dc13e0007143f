//! A long computation in slices, the interface of the workers.
//!
//! **Invariant:** a computation sends one answer, at its end or when it is refused.

use std::time::{Duration, Instant};

/// Longest time of one computation on a worker before the next one. It is short compared with the 5 ms by which a
/// client may be delayed, and long compared with the cost of switching.
pub const SLICE: Duration = Duration::from_millis(1);

/// The state of a computation after a turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It waits for its next turn.
    Unfinished,
    /// It cannot begin yet, and tries again when another has ended, or after a pause.
    Waiting,
    /// It has sent its answer and can be dropped.
    Finished,
}

/// A long computation that is done in slices.
pub trait Computation: Send {
    /// Works until `deadline` or its end, and sends the answer at its end.
    fn advance(&mut self, deadline: Instant) -> Progress;

    /// Whether the caller has disconnected, so the computation can be dropped.
    fn is_abandoned(&self) -> bool {
        false
    }

    /// Sends the answer that the runtime is ending. The computation is dropped afterwards.
    fn refuse(&mut self, why: &'static str);
}
