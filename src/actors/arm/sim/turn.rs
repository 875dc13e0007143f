//! How much the arm does in a row before its timers and the answers that it waits for have their turn.
//!
//! actix empties an actor's mailbox before it polls the actor's timers. A sender that keeps the mailbox full would
//! delay the arm's tick, so the arm yields at the end of a turn.
//!
//! **Invariant:** between two ends of a turn the arm does about two milliseconds of work, at any length of the mailbox:
//! [`TURN`], one message, and one row of steps. Steps that are due have their own budget.

use std::time::{Duration, Instant};

use crate::actors::resources::work_clock;

/// Work on messages in a row: a tick may be late by that.
pub const TURN: Duration = Duration::from_millis(1);
/// Messages in a row, some hundred microseconds of usual ones.
pub const TURN_MESSAGES: usize = 64;

/// The messages since the arm last let its timers have their turn.
pub(super) struct Turn {
    began: Instant,
    messages: usize,
}

impl Turn {
    pub(super) fn new() -> Self {
        Self {
            began: work_clock::now(),
            messages: 0,
        }
    }

    /// Counts a message; whether the turn ends with it.
    pub(super) fn count(&mut self) -> bool {
        self.messages += 1;
        self.messages >= TURN_MESSAGES || work_clock::now() - self.began >= TURN
    }
}
