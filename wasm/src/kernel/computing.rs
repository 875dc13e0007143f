//! Running computations. Each is advanced in pieces, so the arm continues meanwhile.
//!
//! **Invariant:** a computation sends one answer.

use std::marker::PhantomData;

use bytes::Bytes;
use pendularm::services::study::Work;
use pendularm::services::{Address, Answered, ResponseWriter, Streamed};

use super::Clock;

/// A long computation that ends with a response.
pub(super) trait Computation {
    /// Computes a piece. Returns the response after the last one.
    fn advance(&mut self, clock: Clock) -> Option<Bytes>;
}

/// A computation with a short answer.
pub(super) struct Short<A, W> {
    work: W,
    to: Address,
    question: PhantomData<fn(A)>,
}

impl<A, W> Short<A, W> {
    pub(super) fn new(work: W, to: Address) -> Self {
        Self {
            work,
            to,
            question: PhantomData,
        }
    }
}

impl<A: Answered, W: Work<A::Answer>> Computation for Short<A, W> {
    fn advance(&mut self, clock: Clock) -> Option<Bytes> {
        let answer = self.work.advance(clock)?;
        Some(A::write(answer, &self.to))
    }
}

/// A computation whose answer may be long.
pub(super) struct Streaming<A: Streamed> {
    stage: Stage<A>,
    to: Address,
}

enum Stage<A: Streamed> {
    Working(Box<dyn Work<A::Answer>>),
    Writing(Box<dyn ResponseWriter>),
}

impl<A: Streamed> Streaming<A> {
    pub(super) fn new(work: impl Work<A::Answer> + 'static, to: Address) -> Self {
        let stage = Stage::Working(Box::new(work));
        Self { stage, to }
    }
}

impl<A: Streamed> Computation for Streaming<A> {
    fn advance(&mut self, clock: Clock) -> Option<Bytes> {
        match &mut self.stage {
            Stage::Working(work) => {
                let answer = work.advance(clock)?;
                self.stage = Stage::Writing(A::begin(answer, &self.to));
                None
            }
            Stage::Writing(writer) => writer.advance(),
        }
    }
}
