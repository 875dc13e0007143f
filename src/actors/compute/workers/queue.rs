//! The workers' side of the pool: which computation is next, its slice, and its end.
//!
//! **Invariant:** a computation is advanced, refused and dropped outside the lock.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::computation::{Computation, Progress, SLICE};
use super::turns::{Ticket, Turns};
use crate::actors::panics::contain;
use crate::actors::resources::work_clock;

/// Pause between two tries of computations that can't begin.
const TRY_AGAIN: Duration = Duration::from_millis(10);
/// How many of them try at a time: each try looks at what every client holds.
const FEW: usize = 32;

/// The queue, and the news that it has changed.
#[derive(Default)]
pub(super) struct PoolState {
    queue: Mutex<Queue>,
    pub(super) changed: Condvar,
}

pub(super) type Job = Box<dyn Computation>;

/// The computations that are here.
#[derive(Default)]
pub(super) struct Queue {
    pub(super) turns: Turns<Job>,
    /// Computations that can't begin yet.
    waiting: Vec<(Ticket, Job)>,
    /// When the computations that can't begin last tried.
    tried: Option<Instant>,
    pub(super) closed: Option<&'static str>,
}

impl Queue {
    /// Takes out the computations for whose answers nobody waits.
    pub(super) fn take_abandoned(&mut self) -> Vec<Job> {
        self.retry();
        self.turns.take_waiting_if(|job| job.is_abandoned())
    }

    /// Has the computations that could not begin try again.
    pub(super) fn retry(&mut self) {
        self.retry_first(self.waiting.len());
    }

    /// Has so many of them try again. Those that have not tried for longest come first.
    fn retry_first(&mut self, most: usize) {
        self.tried = Some(Instant::now());
        let few = self.waiting.len().min(most);
        for (place, job) in self.waiting.drain(..few) {
            self.turns.wait(place, job);
        }
    }

    pub(super) fn admitted(&self) -> usize {
        self.turns.len() + self.waiting.len()
    }
}

impl PoolState {
    /// The queue. A poisoned lock is taken as it is: the queue is never left half changed.
    pub(super) fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn work(&self) {
        while let Some((place, job)) = self.take() {
            self.advance(place, job);
        }
    }

    /// Gives a computation that was taken its turn.
    pub(super) fn advance(&self, place: Ticket, mut job: Job) {
        let began = work_clock::spent();
        let progress = contain(|| job.advance(work_clock::now() + SLICE));
        let progress = progress.unwrap_or_else(|panic| {
            tracing::error!(%panic, "a computation ended; its caller has an answer");
            Progress::Finished
        });
        let took = work_clock::spent().saturating_sub(began);
        if let Some(end) = self.put_back(place, job, progress, took) {
            self.end(place, end, began);
        }
    }

    fn take(&self) -> Option<(Ticket, Job)> {
        let mut queue = self.lock();
        loop {
            // The other computations may take minutes.
            let is_time = |tried: Instant| tried.elapsed() >= TRY_AGAIN;
            if !queue.waiting.is_empty() && queue.tried.is_none_or(is_time) {
                queue.retry_first(FEW);
                if queue.turns.waiting() > 1 {
                    self.changed.notify_all();
                }
            }
            if let Some(job) = queue.turns.next() {
                return Some(job);
            }
            if queue.closed.is_some() {
                return None;
            }
            if queue.waiting.is_empty() {
                let waited = self.changed.wait(queue);
                queue = waited.unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let waited = self.changed.wait_timeout(queue, TRY_AGAIN);
            (queue, _) = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes a computation back after its turn. If that was its last, returns it, with the reason if it is to be
    /// refused.
    fn put_back(&self, place: Ticket, job: Job, progress: Progress, took: Duration) -> Option<End> {
        let mut queue = self.lock();
        match (progress, queue.closed) {
            (Progress::Finished, _) => return Some(End { job, why: None }),
            (_, Some(why)) => {
                let why = Some(why);
                return Some(End { job, why });
            }
            (Progress::Unfinished, None) => queue.turns.again(place, job, took),
            (Progress::Waiting, None) => {
                let place = queue.turns.leave(place, took);
                queue.waiting.push((place, job));
            }
        }
        None
    }

    /// Ends a computation. Its last turn began when this thread had used so much processor time.
    fn end(&self, place: Ticket, End { mut job, why }: End, began: Duration) {
        // Dropped outside the lock: the end of a computation may free many megabytes.
        let end = contain(move || {
            if let Some(why) = why {
                job.refuse(why);
            }
        });
        if let Err(panic) = end {
            tracing::error!(%panic, "the end of a computation failed");
        }
        let mut queue = self.lock();
        queue
            .turns
            .leave(place, work_clock::spent().saturating_sub(began));
        queue.retry();
        if queue.turns.waiting() > 0 {
            self.changed.notify_all();
        }
    }
}

/// A computation that has had its last turn.
struct End {
    job: Job,
    /// The reason of its refusal, if it has not ended by itself.
    why: Option<&'static str>,
}
