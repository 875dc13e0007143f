//! A few threads that compute long requests in slices, so no client waits for a million steps of another one.
//!
//! A computation is advanced for one slice, and then queued at the end: round robin. A connection has at most one
//! computation here at a time (the others wait in the connection), so each connection has the same share. The
//! computation of a disconnected caller ends at its next slice.
//!
//! **Invariant:** a computation is advanced, refused and dropped outside the lock. A panic ends neither its worker
//! nor another computation.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use crate::actors::panics::contain;
use crate::actors::resources::priority::lower_priority;
use crate::actors::resources::work_clock;

/// Longest time of one computation on a worker before the next one. It is short compared with the 5 ms by which a
/// client may be delayed, and long compared with the cost of switching.
pub const SLICE: Duration = Duration::from_millis(1);

/// The state of a computation after a turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It waits for its next turn.
    Unfinished,
    /// It has sent its answer and can be dropped.
    Finished,
}

/// A long computation that is done in slices.
pub trait Computation: Send {
    /// Works until the [work clock](work_clock) shows `deadline` or to its end, and sends the answer at its end.
    fn advance(&mut self, deadline: Duration) -> Progress;

    /// Sends the answer that the runtime is ending. The computation is dropped afterwards.
    fn refuse(&mut self, why: &'static str);
}

type Job = Box<dyn Computation>;

/// A handle on the pool; clones share it.
#[derive(Clone, Default)]
pub struct WorkerPool {
    shared: Arc<(Mutex<Queue>, Condvar)>,
}

/// The present computations.
#[derive(Default)]
struct Queue {
    /// Computations that wait for their next slice.
    ready: VecDeque<Job>,
    running: usize,
    closed: Option<&'static str>,
}

impl Queue {
    fn next(&mut self) -> Option<Job> {
        let job = self.ready.pop_front()?;
        self.running += 1;
        Some(job)
    }
}

impl WorkerPool {
    /// Starts `threads` workers (at least one). They end with [`WorkerPool::close`].
    ///
    /// # Errors
    /// The operating system's error, if it refuses a thread.
    pub fn start(threads: usize) -> std::io::Result<Self> {
        let pool = Self::without_threads();
        for number in 0..threads.max(1) {
            let pool = pool.clone();
            let name = format!("worker-{number}");
            thread::Builder::new().name(name).spawn(move || {
                lower_priority();
                while let Some(job) = pool.take() {
                    pool.advance(job);
                }
            })?;
        }
        Ok(pool)
    }

    /// A pool without workers, whose owner calls [`WorkerPool::turn`]. It is for tests with only one thread.
    #[must_use]
    pub fn without_threads() -> Self {
        Self::default()
    }

    /// Computes the next slice in the calling thread; `false` if there is none.
    #[must_use]
    pub fn turn(&self) -> bool {
        let next = self.lock().next();
        next.map(|job| self.advance(job)).is_some()
    }

    /// The number of cores minus one, so the arm and the gateway keep one.
    #[must_use]
    pub fn default_threads() -> usize {
        thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).clamp(1, 4))
    }

    /// Accepts a computation, or refuses it if the pool is closed.
    pub fn submit(&self, mut computation: Job) {
        let mut queue = self.lock();
        let Some(why) = queue.closed else {
            queue.ready.push_back(computation);
            return self.shared.1.notify_one();
        };
        drop(queue);
        computation.refuse(why);
    }

    /// Refuses the waiting computations, and the running ones after their slice, for the reason `why`. Then the workers
    /// end.
    pub fn close(&self, why: &'static str) {
        let waiting = {
            let mut queue = self.lock();
            queue.closed = Some(why);
            std::mem::take(&mut queue.ready)
        };
        self.shared.1.notify_all();
        for mut job in waiting {
            job.refuse(why);
        }
    }

    /// Whether no computation waits or runs.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        let queue = self.lock();
        queue.ready.is_empty() && queue.running == 0
    }

    /// The queue. A poisoned lock is used, because the queue is never half changed.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next computation of a worker. `None` when the pool is closed.
    fn take(&self) -> Option<Job> {
        let mut queue = self.lock();
        loop {
            if queue.closed.is_some() {
                return None;
            }
            if let Some(job) = queue.next() {
                return Some(job);
            }
            let woken = self.shared.1.wait(queue);
            queue = woken.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Computes a slice, and queues the computation again unless it has ended.
    fn advance(&self, mut job: Job) {
        let progress = contain(|| job.advance(work_clock::now() + SLICE));
        let progress = progress.unwrap_or_else(|panic| {
            tracing::error!(%panic, "a computation ended; its caller has an answer");
            Progress::Finished
        });
        let why = {
            let mut queue = self.lock();
            match (progress, queue.closed) {
                (Progress::Finished, _) => None,
                (_, Some(why)) => Some(why),
                (_, None) => {
                    queue.running -= 1;
                    return queue.ready.push_back(job);
                }
            }
        };
        // Dropping a computation may free many megabytes.
        let end = contain(move || why.map(|why| job.refuse(why)).unwrap_or_default());
        if let Err(panic) = end {
            tracing::error!(%panic, "the end of a computation failed");
        }
        let mut queue = self.lock();
        queue.running -= 1;
        self.shared.1.notify_all();
    }
}

#[cfg(test)]
mod tests;
