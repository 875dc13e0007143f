//! Patience with a client that takes nothing of what is written to it.
//!
//! **Invariant:** it ends only for a client that is finishing, or for which responses have waited all the time.

use std::cell::Cell;

use tokio::time::Instant;

use crate::actors::gateway::limits::{LINGER, STALL_LIMIT};

/// The times from which patience is counted.
pub(super) struct Patience {
    /// The time since which responses have been waiting without a break.
    responses_since: Cell<Option<Instant>>,
    /// When the client last took a byte of a write that goes on.
    taken: Cell<Instant>,
}

impl Patience {
    pub(super) fn new() -> Self {
        Self {
            responses_since: Cell::new(None),
            taken: Cell::new(Instant::now()),
        }
    }

    /// The first response waits.
    pub(super) fn note_first_response(&self) {
        self.responses_since.set(Some(Instant::now()));
    }

    /// No response waits any more.
    pub(super) fn note_last_response(&self) {
        self.responses_since.set(None);
    }

    /// The client has taken some of what is being written.
    #[cfg(feature = "web")]
    pub(super) fn note_taken(&self) {
        self.taken.set(Instant::now());
    }

    /// When a client that has taken nothing since `last_byte` is given up; `None` if it never is.
    pub(super) fn end(
        &self,
        last_byte: Instant,
        is_finishing: bool,
        has_long: bool,
    ) -> Option<Instant> {
        let last_byte = last_byte.max(self.taken.get());
        match self.responses_since.get() {
            Some(since) => Some(since.max(last_byte) + STALL_LIMIT),
            None if has_long && !is_finishing => Some(last_byte + STALL_LIMIT),
            None => is_finishing.then(|| last_byte + LINGER),
        }
    }
}
