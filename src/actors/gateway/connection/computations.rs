//! The heavy calls of one client: one runs, some wait.
//!
//! **Invariant:** they run one after the other, in the order in which they came.

use std::collections::VecDeque;

use crate::actors::gateway::limits::MAX_COMPUTATIONS_WAITING;
use crate::actors::gateway::messages::Request;
use crate::actors::resources::budget::Share;

/// The calls, each with its share of the client's account.
#[derive(Default)]
pub(super) struct Computations {
    waiting: VecDeque<(Request, Share)>,
    /// The memory of the request that runs, if one does.
    running: Option<Share>,
}

impl Computations {
    pub(super) fn push(&mut self, request: Request, share: Share) {
        self.waiting.push_back((request, share));
    }

    /// Whether so many wait that the client is not read.
    pub(super) fn are_too_many(&self) -> bool {
        self.waiting.len() >= MAX_COMPUTATIONS_WAITING
    }

    /// Whether one waits and none runs.
    pub(super) fn can_start(&self) -> bool {
        self.running.is_none() && !self.waiting.is_empty()
    }

    /// Takes the next call; it runs from now on.
    pub(super) fn start(&mut self) -> Option<Request> {
        let (request, share) = self.waiting.pop_front()?;
        self.running = Some(share);
        Some(request)
    }

    /// Notes that the running call has been answered.
    pub(super) fn end(&mut self) {
        self.running = None;
    }

    /// Whether none runs and none waits.
    pub(super) fn is_empty(&self) -> bool {
        self.running.is_none() && self.waiting.is_empty()
    }
}
