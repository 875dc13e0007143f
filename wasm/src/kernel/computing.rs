//! Running computations. Each is advanced in pieces, so the arm continues meanwhile.
//!
//! **Invariant:** a computation sends one answer.

use std::marker::PhantomData;

use bytes::Bytes;
use pendularm::services::study::Work;
use pendularm::services::{Address, Ask};

use super::Clock;

/// A long computation that ends with a response.
pub(super) trait Computation {
    /// Computes a piece. Returns the response after the last one.
    fn advance(&mut self, clock: Clock) -> Option<Bytes>;
}

/// Work, and the caller that gets its answer.
pub(super) struct Answering<A, W> {
    work: W,
    to: Address,
    question: PhantomData<fn(A)>,
}

impl<A, W> Answering<A, W> {
    pub(super) fn new(work: W, to: Address) -> Self {
        Self {
            work,
            to,
            question: PhantomData,
        }
    }
}

impl<A: Ask, W: Work<A::Answer>> Computation for Answering<A, W> {
    fn advance(&mut self, clock: Clock) -> Option<Bytes> {
        let answer = self.work.advance(clock)?;
        Some(A::write(answer, &self.to))
    }
}
