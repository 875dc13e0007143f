//! The heavy calls of one client: one runs, and others wait.
//!
//! **Invariant:** they run one at a time, in order of arrival.

use std::collections::VecDeque;

use crate::actors::gateway::limits::MAX_COMPUTATIONS_WAITING;
use crate::actors::gateway::messages::Request;
use crate::actors::resources::memory::SHORT;

/// The calls, each with the length of its frame.
#[derive(Default)]
pub(super) struct Computations {
    waiting: VecDeque<(Request, usize)>,
    /// Bytes of the waiting calls.
    bytes: usize,
    is_running: bool,
}

impl Computations {
    pub(super) fn push(&mut self, request: Request, length: usize) {
        self.bytes += length;
        self.waiting.push_back((request, length));
    }

    /// Whether too many calls or bytes wait, so that the client is not read.
    pub(super) fn are_too_many(&self) -> bool {
        self.waiting.len() >= MAX_COMPUTATIONS_WAITING || self.bytes >= SHORT
    }

    /// Whether a call waits and none runs.
    pub(super) fn can_start(&self) -> bool {
        !self.is_running && !self.waiting.is_empty()
    }

    /// Removes and returns the next call, and marks it as running.
    pub(super) fn start(&mut self) -> Option<Request> {
        let (request, length) = self.waiting.pop_front()?;
        self.bytes -= length;
        self.is_running = true;
        Some(request)
    }

    /// Notes that the running call has been answered.
    pub(super) fn end(&mut self) {
        self.is_running = false;
    }

    /// Whether none runs and none waits.
    pub(super) fn is_empty(&self) -> bool {
        !self.is_running && self.waiting.is_empty()
    }
}
