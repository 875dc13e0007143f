//! A call on the workers: it takes memory for its answer, then the answer is computed and written.
//!
//! **Invariant:** a call is answered once. It stops when its caller disconnects.

use std::time::Duration;

use super::workers::{Computation, Progress, WorkerPool};
use crate::actors::node::{Reply, Unserved};
use crate::actors::resources::memory::NoRoom;
use crate::actors::resources::work_clock;
use crate::services::study::Work;

/// Passes a call to the workers.
pub(super) fn answer<T: Send + 'static>(
    workers: &WorkerPool,
    reply: Reply<T>,
    work: impl Work<T> + 'static,
) {
    let answering = Answering {
        reply: Some(reply),
        has_room: false,
        work,
    };
    workers.submit(Box::new(answering));
}

struct Answering<T, W> {
    /// None once it has been answered.
    reply: Option<Reply<T>>,
    /// Whether room for the answer has been taken.
    has_room: bool,
    work: W,
}

impl<T: Send, W: Work<T>> Computation for Answering<T, W> {
    fn advance(&mut self, deadline: Duration) -> Progress {
        while let Some(reply) = &mut self.reply {
            if reply.caller_is_gone() {
                self.end(Unserved::CALLER_GONE);
                break;
            }
            if !self.has_room {
                if let Err(NoRoom) = reply.reserve(self.work.most_bytes()) {
                    return Progress::Waiting;
                }
                self.has_room = true;
            } else if let Some(answer) = self.work.advance(work_clock::now) {
                // Megabytes take a worker some tenths of a second, in which it does nothing else.
                reply.answer(answer);
                self.reply = None;
                break;
            }
            if work_clock::now() >= deadline {
                return Progress::Unfinished;
            }
        }
        Progress::Finished
    }

    fn refuse(&mut self, why: &'static str) {
        self.end(Unserved(why));
    }
}

impl<T, W> Answering<T, W> {
    fn end(&mut self, why: Unserved) {
        if let Some(mut reply) = self.reply.take() {
            reply.refuse(why);
        }
    }
}
