//! Limits the arm's work in a row before its timers and awaited answers are polled.
//!
//! actix empties an actor's mailbox before it polls the actor's timers. A sender that keeps the mailbox full would
//! delay the arm's tick, so the arm yields at the end of a turn.
//!
//! **Invariant:** between two ends of a turn the arm does about two milliseconds of work, at any length of the mailbox:
//! [`TURN`], one message, and one row of steps. Due steps have their own budget.

use std::time::Duration;

use crate::actors::resources::work_clock;

/// Most work on messages in a row. A tick may be late by that time.
pub const TURN: Duration = Duration::from_millis(1);
/// Most messages in a row: some hundred microseconds of usual ones.
pub const TURN_MESSAGES: usize = 64;

/// The messages since the timers were last polled.
pub(super) struct Turn {
    began: Duration,
    messages: usize,
}

impl Turn {
    pub(super) fn new() -> Self {
        Self {
            began: work_clock::now(),
            messages: 0,
        }
    }

    /// Counts a message. Returns whether the turn ends with it.
    pub(super) fn count(&mut self) -> bool {
        self.messages += 1;
        self.messages >= TURN_MESSAGES || work_clock::now() - self.began >= TURN
    }
}
