//! A few threads that do the heavy requests in turns, so that no client waits for another's million steps.
//!
//! A computation is advanced for one slice and goes to the back of the queue. A connection has at most one computation
//! here at a time (the rest wait in the connection), so the turns go round the connections.
//!
//! A long computation comes to hold a hundred megabytes of results. So one that has had [`SHORT_SLICES`] turns is long,
//! and only [`MAX_LONG`] long ones take turns; the others wait, and still hold little. Short ones never wait for long ones.
//!
//! At most [`MAX_ADMITTED`] are here at once, all clients' together: one more is refused, so that a pool that is stuck holds up nobody for ever.
//!
//! **Invariant:** a computation that panics takes neither its worker nor anybody else's computation with it.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::panics::contain;

/// How long one computation may keep a worker before the next one has its turn: short beside the 5 ms that a client
/// may be delayed, long beside the cost of changing over.
pub const SLICE: Duration = Duration::from_millis(1);

/// Turns after which a computation is long: enough for some ten thousand steps, so for nearly all that is asked.
pub const SHORT_SLICES: u32 = 16;
/// Long computations that take turns with one another: what they hold together stays below half a gigabyte.
pub const MAX_LONG: usize = 4;

/// Computations that may be here at once, waiting or running: four clients in ten may have one each. The rest is refused.
pub const MAX_ADMITTED: usize = 256;
/// What the caller of one too many is told.
pub const BUSY: &str =
    "busy: as many computations of all clients wait as may wait; try again later";

/// How often those that can't begin try again while nothing else is computed.
const TRY_AGAIN: Duration = Duration::from_millis(10);

/// Whether a computation wants another turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It goes to the back of the queue.
    Unfinished,
    /// It can't begin yet: it tries again when another has ended, or after a moment.
    Waiting,
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
    /// Whose turn comes next.
    turns: VecDeque<Job>,
    /// Long computations for which there is no place among the turns yet.
    parked: VecDeque<Job>,
    /// Those that can't begin yet.
    waiting: VecDeque<Job>,
    /// Long computations among the turns, those that run included.
    long: usize,
    running: usize,
    closed: Option<&'static str>,
}

/// A computation and how often it has had its turn.
struct Job {
    computation: Box<dyn Computation>,
    slices: u32,
}

impl Job {
    fn is_long(&self) -> bool {
        self.slices >= SHORT_SLICES
    }
}

impl Queue {
    /// Puts a computation back that has just had its turn.
    fn put_back(&mut self, job: Job) {
        // It becomes long once.
        if job.slices == SHORT_SLICES {
            if self.long == MAX_LONG {
                self.parked.push_back(job);
                return;
            }
            self.long += 1;
        }
        self.turns.push_back(job);
    }

    /// A computation has ended: those that waited for that try again, and if it was a long one, the next has its place.
    fn end(&mut self, was_long: bool) {
        self.turns.append(&mut self.waiting);
        if was_long {
            match self.parked.pop_front() {
                Some(next) => self.turns.push_back(next),
                None => self.long -= 1,
            }
        }
    }

    fn admitted(&self) -> usize {
        self.running + self.turns.len() + self.parked.len() + self.waiting.len()
    }
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

    /// Puts a computation at the back of the queue; refuses it if the pool is closed, or has as many as it may have.
    pub fn submit(&self, mut computation: Box<dyn Computation>) {
        let why = {
            let mut queue = self.shared.lock();
            if queue.closed.is_none() && queue.admitted() < MAX_ADMITTED {
                let slices = 0;
                queue.turns.push_back(Job {
                    computation,
                    slices,
                });
                self.shared.changed.notify_one();
                return;
            }
            queue.closed.unwrap_or(BUSY)
        };
        computation.refuse(why);
    }

    /// Refuses what waits and what runs (at the end of its slice) for the reason `why`, then ends the workers.
    pub fn close(&self, why: &'static str) {
        let waiting = {
            let mut queue = self.shared.lock();
            queue.closed = Some(why);
            let mut waiting = std::mem::take(&mut queue.turns);
            waiting.append(&mut queue.parked);
            waiting.append(&mut queue.waiting);
            waiting
        };
        self.shared.changed.notify_all();
        for mut job in waiting {
            job.computation.refuse(why);
        }
    }

    /// True when nothing waits and nothing runs.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        let queue = self.shared.lock();
        queue.admitted() == 0
    }
}

impl Shared {
    /// The queue. A poisoned lock is taken as it is: the queue is never left half changed.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        while let Some(mut job) = self.take() {
            let progress = contain(|| job.computation.advance(Instant::now() + SLICE));
            let progress = progress.unwrap_or_else(|panic| {
                tracing::error!(%panic, "a computation ended; its caller is told so");
                Progress::Finished
            });
            self.put_back(job, progress);
        }
    }

    fn take(&self) -> Option<Job> {
        let mut queue = self.lock();
        loop {
            if let Some(job) = queue.turns.pop_front() {
                queue.running += 1;
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
            let end;
            (queue, end) = waited.unwrap_or_else(PoisonError::into_inner);
            if end.timed_out() {
                let queue = &mut *queue;
                queue.turns.append(&mut queue.waiting);
            }
        }
    }

    fn put_back(&self, mut job: Job, progress: Progress) {
        let was_long = job.is_long();
        let closed = {
            let mut queue = self.lock();
            if progress != Progress::Finished && queue.closed.is_none() {
                queue.running -= 1;
                if progress == Progress::Waiting {
                    queue.waiting.push_back(job);
                } else {
                    job.slices = job.slices.saturating_add(1);
                    queue.put_back(job);
                }
                return;
            }
            queue.closed
        };
        // Dropped outside the lock: the end of a computation may free many megabytes.
        let end = contain(move || {
            if progress != Progress::Finished {
                job.computation.refuse(closed.unwrap_or_default());
            }
        });
        if let Err(panic) = end {
            tracing::error!(%panic, "the end of a computation failed");
        }
        let mut queue = self.lock();
        queue.running -= 1;
        queue.end(was_long);
        if !queue.turns.is_empty() {
            self.changed.notify_all();
        }
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
            for (name, slices) in [("a", 3), ("b", 2)] {
                queue.turns.push_back(Job {
                    computation: computation(name, slices, &log),
                    slices: 0,
                });
            }
        }
        pool.shared.changed.notify_all();
        let order: Vec<String> = seen.iter().take(5).collect();
        assert_eq!(order, ["a", "b", "a", "b", "a"]);
    }

    /// The last of the long ones has its first turns with the others and then waits until one of them has ended.
    #[test]
    fn few_long_computations_take_turns_and_short_ones_wait_for_none() {
        const NAMES: [&str; MAX_LONG + 1] = ["a", "b", "c", "d", "parked"];
        let long = 3 * SHORT_SLICES as usize;
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        {
            let mut queue = pool.shared.lock();
            for name in NAMES {
                queue.turns.push_back(Job {
                    computation: computation(name, long, &log),
                    slices: 0,
                });
            }
        }
        pool.submit(computation("short", 2, &log));
        let order: Vec<String> = seen.iter().take(NAMES.len() * long + 2).collect();
        let turns_of = |name: &str| -> Vec<usize> {
            let turns = order.iter().enumerate().filter(|(_, turn)| *turn == name);
            turns.map(|(at, _)| at).collect()
        };
        assert_eq!(turns_of("short").len(), 2);
        assert!(turns_of("short")[1] <= 2 * (NAMES.len() + 1), "{order:?}");
        let parked = turns_of("parked");
        assert_eq!(parked.len(), long);
        let first_end = NAMES[..MAX_LONG]
            .iter()
            .map(|name| turns_of(name)[long - 1])
            .min();
        let resumed = parked[SHORT_SLICES as usize];
        assert!(first_end.unwrap() < resumed, "{order:?}");
        while !pool.is_idle() {
            thread::yield_now();
        }
        assert_eq!(pool.shared.lock().long, 0);
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
