//! The computations of one client: one runs, and the others wait in the order of arrival.
//!
//! **Invariant:** at most one computation of a client runs.

use std::collections::VecDeque;

use crate::actors::resources::memory::SHORT;

/// Most waiting computations of one client, besides the running one. At this limit the client is not read.
pub const MAX_COMPUTATIONS_WAITING: usize = 16;

/// The computations of a client. `T` is the call of one.
pub struct Computations<T> {
    /// Each with the length of its frame \[bytes\].
    waiting: VecDeque<(T, usize)>,
    is_running: bool,
}

impl<T> Default for Computations<T> {
    fn default() -> Self {
        Self {
            waiting: VecDeque::new(),
            is_running: false,
        }
    }
}

impl<T> Computations<T> {
    /// Adds a call, whose frame had `length` bytes.
    pub fn push(&mut self, call: T, length: usize) {
        self.waiting.push_back((call, length));
    }

    /// The next call, if none runs. It runs from now on.
    pub fn start(&mut self) -> Option<T> {
        if self.is_running {
            return None;
        }
        let (call, _) = self.waiting.pop_front()?;
        self.is_running = true;
        Some(call)
    }

    /// The running computation has been answered.
    pub const fn end(&mut self) {
        self.is_running = false;
    }

    /// Whether too many calls wait, or too many bytes of their frames.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let bytes: usize = self.waiting.iter().map(|(_, length)| length).sum();
        self.waiting.len() >= MAX_COMPUTATIONS_WAITING || bytes >= SHORT
    }

    /// Whether no computation runs or waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.is_running && self.waiting.is_empty()
    }
}
