//! A few threads that do the heavy requests in turns, so that no client waits for another's million steps.
//!
//! A computation is advanced for one slice and goes to the back of the queue. A connection has at most one computation
//! here at a time (the rest wait in the connection), so the turns go round the connections.
//!
//! **Invariant:** a computation that panics takes neither its worker nor anybody else's computation with it.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How long one computation may keep a worker before the next one has its turn: short beside the 5 ms that a client
/// may be delayed, long beside the cost of changing over.
pub const SLICE: Duration = Duration::from_millis(1);

/// Whether a computation wants another turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It goes to the back of the queue.
    Unfinished,
    /// It has answered and can be dropped.
    Finished,
}

/// Something heavy that is done a slice at a time.
pub trait Computation: Send {
    /// Works until `deadline` or the end, whichever is first, and answers at the end.
    fn advance(&mut self, deadline: Instant) -> Progress;

    /// Answers that the runtime is ending; the computation is dropped afterwards.
    fn refuse(&mut self, why: &str);
}

/// A handle on the pool; clones share it.
#[derive(Clone)]
pub struct WorkerPool {
    shared: Arc<Shared>,
}

struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Box<dyn Computation>>,
    running: usize,
    closed: Option<&'static str>,
}

impl WorkerPool {
    /// Starts `threads` workers (at least one). They end with [`WorkerPool::close`].
    ///
    /// # Errors
    /// The operating system's, if it refuses a thread.
    pub fn start(threads: usize) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            queue: Mutex::default(),
            changed: Condvar::new(),
        });
        for number in 0..threads.max(1) {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name(format!("worker-{number}"))
                .spawn(move || shared.work())?;
        }
        Ok(Self { shared })
    }

    /// One worker fewer than the machine has cores, so that the arm and the gateway keep one.
    #[must_use]
    pub fn default_threads() -> usize {
        thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).clamp(1, 4))
    }

    /// Puts a computation at the back of the queue; refuses it if the pool is closed.
    pub fn submit(&self, mut computation: Box<dyn Computation>) {
        let closed = {
            let mut queue = self.shared.lock();
            if queue.closed.is_none() {
                queue.waiting.push_back(computation);
                self.shared.changed.notify_one();
                return;
            }
            queue.closed
        };
        computation.refuse(closed.unwrap_or_default());
    }

    /// Refuses what waits and what runs (at the end of its slice) for the reason `why`, then ends the workers.
    pub fn close(&self, why: &'static str) {
        let waiting = {
            let mut queue = self.shared.lock();
            queue.closed = Some(why);
            std::mem::take(&mut queue.waiting)
        };
        self.shared.changed.notify_all();
        for mut computation in waiting {
            computation.refuse(why);
        }
    }

    /// True when nothing waits and nothing runs.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        let queue = self.shared.lock();
        queue.running == 0 && queue.waiting.is_empty()
    }
}

impl Shared {
    /// The queue. A poisoned lock is taken as it is: the queue is never left half changed.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        while let Some(mut computation) = self.take() {
            let slice = AssertUnwindSafe(|| computation.advance(Instant::now() + SLICE));
            let progress = catch_unwind(slice).unwrap_or_else(|_| {
                tracing::error!("a computation panicked; its caller is told that it ended");
                Progress::Finished
            });
            self.put_back(computation, progress);
        }
    }

    fn take(&self) -> Option<Box<dyn Computation>> {
        let mut queue = self.lock();
        loop {
            if let Some(computation) = queue.waiting.pop_front() {
                queue.running += 1;
                return Some(computation);
            }
            if queue.closed.is_some() {
                return None;
            }
            queue = self
                .changed
                .wait(queue)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn put_back(&self, mut computation: Box<dyn Computation>, progress: Progress) {
        let closed = {
            let mut queue = self.lock();
            if progress == Progress::Unfinished && queue.closed.is_none() {
                queue.running -= 1;
                queue.waiting.push_back(computation);
                return;
            }
            queue.closed
        };
        // Dropped outside the lock: the end of a computation may free many megabytes.
        if progress == Progress::Unfinished {
            computation.refuse(closed.unwrap_or_default());
        }
        drop(computation);
        self.lock().running -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    struct Counting {
        name: &'static str,
        slices: usize,
        log: mpsc::Sender<String>,
    }

    impl Computation for Counting {
        fn advance(&mut self, _deadline: Instant) -> Progress {
            assert!(self.name != "panics", "asked to");
            self.log.send(self.name.to_owned()).unwrap();
            self.slices -= 1;
            if self.slices == 0 {
                Progress::Finished
            } else {
                Progress::Unfinished
            }
        }

        fn refuse(&mut self, why: &str) {
            self.log.send(format!("{}: {why}", self.name)).unwrap();
        }
    }

    fn computation(
        name: &'static str,
        slices: usize,
        log: &mpsc::Sender<String>,
    ) -> Box<dyn Computation> {
        Box::new(Counting {
            name,
            slices,
            log: log.clone(),
        })
    }

    #[test]
    fn computations_take_turns() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        {
            // Both wait before the worker takes the first: the lock is held meanwhile.
            let mut queue = pool.shared.lock();
            queue.waiting.push_back(computation("a", 3, &log));
            queue.waiting.push_back(computation("b", 2, &log));
        }
        pool.shared.changed.notify_all();
        let order: Vec<String> = seen.iter().take(5).collect();
        assert_eq!(order, ["a", "b", "a", "b", "a"]);
    }

    #[test]
    fn a_panic_leaves_the_worker_working() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        pool.submit(computation("panics", 1, &log));
        pool.submit(computation("next", 1, &log));
        assert_eq!(seen.recv().unwrap(), "next");
    }

    #[test]
    fn a_closed_pool_refuses() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        pool.close("shutting down");
        pool.submit(computation("late", 1, &log));
        assert_eq!(seen.recv().unwrap(), "late: shutting down");
        assert!(pool.is_idle());
    }
}
