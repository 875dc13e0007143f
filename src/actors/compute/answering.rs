//! A call on the workers: it takes memory for its answer, then the answer is computed and written.
//!
//! **Invariant:** a call is answered once. It stops when its caller disconnects.

use std::time::Instant;

use super::workers::{Computation, Progress, WorkerPool};
use crate::actors::node::{Pieces, Reply, Unserved};
use crate::actors::resources::memory::NoRoom;
use crate::actors::resources::work_clock;
use crate::services::study::Work;

/// Passes a call to the workers.
pub(super) fn answer<T: Send + 'static>(
    workers: &WorkerPool,
    reply: Reply<T>,
    work: impl Work<T> + 'static,
) {
    let of = reply.client();
    let stage = AnsweringStage::Asked(Box::new(work));
    workers.submit(of, Box::new(Answering { reply, stage }));
}

struct Answering<T> {
    reply: Reply<T>,
    stage: AnsweringStage<T>,
}

enum AnsweringStage<T> {
    /// Memory for the answer has not been taken yet.
    Asked(Box<dyn Work<T>>),
    Working(Box<dyn Work<T>>),
    Writing(Box<dyn Pieces>),
    Answered,
}

impl<T: Send> Answering<T> {
    fn caller_is_gone(&self) -> bool {
        match &self.stage {
            AnsweringStage::Writing(pieces) => pieces.is_gone(),
            _ => self.reply.caller_is_gone(),
        }
    }

    fn end(&mut self, why: Unserved) {
        match std::mem::replace(&mut self.stage, AnsweringStage::Answered) {
            AnsweringStage::Asked(_) | AnsweringStage::Working(_) => self.reply.refuse(why),
            AnsweringStage::Writing(mut pieces) => pieces.refuse(why),
            // The pool may end between the answer and the last check of the clock.
            AnsweringStage::Answered => {}
        }
    }
}

impl<T: Send> Computation for Answering<T> {
    fn advance(&mut self, deadline: Instant) -> Progress {
        while !matches!(self.stage, AnsweringStage::Answered) {
            if self.caller_is_gone() {
                self.end(Unserved::CallerGone);
            }
            self.stage = match std::mem::replace(&mut self.stage, AnsweringStage::Answered) {
                AnsweringStage::Asked(work) => match self.reply.reserve(work.most_bytes()) {
                    Ok(()) => AnsweringStage::Working(work),
                    Err(NoRoom) => {
                        self.stage = AnsweringStage::Asked(work);
                        return Progress::Waiting;
                    }
                },
                AnsweringStage::Working(mut work) => match work.advance(work_clock::reading) {
                    None => AnsweringStage::Working(work),
                    Some(answer) => AnsweringStage::Writing(self.reply.answer_in_pieces(answer)),
                },
                AnsweringStage::Writing(mut pieces) => {
                    if pieces.advance() {
                        AnsweringStage::Answered
                    } else {
                        AnsweringStage::Writing(pieces)
                    }
                }
                AnsweringStage::Answered => AnsweringStage::Answered,
            };
            if work_clock::now() >= deadline && !matches!(self.stage, AnsweringStage::Answered) {
                return Progress::Unfinished;
            }
        }
        Progress::Finished
    }

    fn is_abandoned(&self) -> bool {
        self.caller_is_gone()
    }

    fn refuse(&mut self, why: &'static str) {
        self.end(Unserved::Refused(why));
    }
}
