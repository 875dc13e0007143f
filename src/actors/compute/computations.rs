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
    /// The length of the frame of the one that runs.
    running: Option<usize>,
}

impl<T> Default for Computations<T> {
    fn default() -> Self {
        Self {
            waiting: VecDeque::new(),
            running: None,
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
        if self.running.is_some() {
            return None;
        }
        let (call, length) = self.waiting.pop_front()?;
        self.running = Some(length);
        Some(call)
    }

    /// The running computation has been answered.
    pub const fn end(&mut self) {
        self.running = None;
    }

    /// Whether too many calls wait, or too many bytes of the frames of all.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let waiting = self.waiting.iter().map(|(_, length)| *length);
        let bytes: usize = waiting.chain(self.running).sum();
        self.waiting.len() >= MAX_COMPUTATIONS_WAITING || bytes >= SHORT
    }

    /// Whether no computation runs or waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.running.is_none() && self.waiting.is_empty()
    }
}
