//! A call on the workers: it takes memory for its answer, then the answer is computed and written.
//!
//! **Invariant:** a call is answered once. It stops when its caller disconnects.

use std::time::Duration;

use super::workers::{Computation, Progress, WorkerPool};
use crate::actors::node::{Reply, Unserved};
use crate::actors::resources::work_clock;
use crate::services::study::Work;

/// Passes a call to the workers.
pub(super) fn answer<T: Send + 'static>(
    workers: &WorkerPool,
    reply: Reply<T>,
    work: impl Work<T> + 'static,
) {
    let answering = Answering {
        reply,
        has_room: false,
        work,
    };
    workers.submit(Box::new(answering));
}

struct Answering<T, W> {
    reply: Reply<T>,
    /// Whether room for the answer has been taken.
    has_room: bool,
    work: W,
}

impl<T: Send, W: Work<T>> Computation for Answering<T, W> {
    fn advance(&mut self, deadline: Duration) -> Progress {
        loop {
            if self.reply.caller_is_gone() {
                self.reply.refuse(Unserved::CALLER_GONE);
                return Progress::Finished;
            }
            if !self.has_room {
                self.has_room = self.reply.reserve(self.work.most_bytes());
                if !self.has_room {
                    return Progress::Waiting;
                }
            } else if let Some(answer) = self.work.advance(work_clock::now) {
                // Megabytes take a worker some tenths of a second, in which it does nothing else.
                self.reply.answer(answer);
                return Progress::Finished;
            }
            if work_clock::now() >= deadline {
                return Progress::Unfinished;
            }
        }
    }

    fn refuse(&mut self, why: &'static str) {
        self.reply.refuse(Unserved(why));
    }
}
