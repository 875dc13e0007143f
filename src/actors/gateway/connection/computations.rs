//! The heavy calls of one client: one runs, some wait.
//!
//! **Invariant:** they run one after the other, in the order in which they came.

use std::collections::VecDeque;

use crate::actors::gateway::limits::MAX_COMPUTATIONS_WAITING;
use crate::actors::gateway::messages::Request;
use crate::actors::resources::memory::SHORT;

/// The calls, each with the length of its frame.
#[derive(Default)]
pub(super) struct Computations {
    waiting: VecDeque<(Request, usize)>,
    /// Bytes of those that wait.
    bytes: usize,
    is_running: bool,
}

impl Computations {
    pub(super) fn push(&mut self, request: Request, length: usize) {
        self.bytes += length;
        self.waiting.push_back((request, length));
    }

    /// Whether the client is not read because of the number or the bytes that wait.
    pub(super) fn are_too_many(&self) -> bool {
        self.waiting.len() >= MAX_COMPUTATIONS_WAITING || self.bytes >= SHORT
    }

    /// Whether one waits and none runs.
    pub(super) fn can_start(&self) -> bool {
        !self.is_running && !self.waiting.is_empty()
    }

    /// Takes the next call; it runs from now on.
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
