//! Something heavy, cut into slices: a computation as the workers see it.
//!
//! **Invariant:** a computation answers once, at its end or when it is refused.

use std::time::{Duration, Instant};

/// How long one computation may keep a worker before the next one has its turn. It is short beside the 5 ms that a
/// client may be delayed, and long beside the cost of changing over.
pub const SLICE: Duration = Duration::from_millis(1);

/// Whether a computation wants another turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It waits for its next turn.
    Unfinished,
    /// It can't begin yet, and tries again when another has ended, or after a moment.
    Waiting,
    /// It has answered and can be dropped.
    Finished,
}

/// Something heavy that is done a slice at a time.
pub trait Computation: Send {
    /// Works until `deadline` or the end, whichever is first, and answers at the end.
    fn advance(&mut self, deadline: Instant) -> Progress;

    /// Whether nobody waits for the answer any more, so that it may be dropped.
    fn is_abandoned(&self) -> bool {
        false
    }

    /// Answers that the runtime is ending; the computation is dropped afterwards.
    fn refuse(&mut self, why: &'static str);
}
