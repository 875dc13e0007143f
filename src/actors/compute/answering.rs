//! A call on the workers: it waits for memory for its answer, then the answer is computed and written.
//!
//! **Invariant:** a call is answered once. It stops when its caller disconnects.

use std::time::Duration;

use super::workers::{Computation, Progress, WorkerPool};
use crate::actors::node::{Reply, Unserved};
use crate::actors::resources::work_clock;
use crate::services::study::Work;

/// Passes a call to the workers, once there is memory for its answer.
pub(super) async fn answer<T: Send + 'static>(
    workers: WorkerPool,
    mut reply: Reply<T>,
    work: impl Work<T> + 'static,
) {
    if reply.reserve(work.most_bytes()).await {
        workers.submit(Box::new(Answering { reply, work }));
    }
}

struct Answering<T, W> {
    reply: Reply<T>,
    work: W,
}

impl<T: Send, W: Work<T>> Computation for Answering<T, W> {
    fn advance(&mut self, deadline: Duration) -> Progress {
        loop {
            if self.reply.caller_is_gone() {
                self.reply.refuse(Unserved::CALLER_GONE);
                return Progress::Finished;
            }
            if let Some(answer) = self.work.advance(work_clock::now) {
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
