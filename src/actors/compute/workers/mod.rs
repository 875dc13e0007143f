//! A few threads that do the heavy requests in turns, so that no client waits for another's million steps.
//!
//! A computation is advanced for one slice and waits for its next turn, which goes to whoever has had least of the
//! workers' processor time (`workers/turns.rs`): a worker that a busy machine keeps waiting is charged to nobody. A
//! connection has at most one computation here at a time (the rest wait in the connection), so each
//! connection gets the same share, and one that asks for little waits for nobody who asks for much. What they hold together is
//! counted when room is taken for its answer ([`Reply::reserve`](crate::actors::node::Reply::reserve)).
//!
//! At most [`MAX_ADMITTED`] are here at once, one for every connection that there can be: nobody is refused because of what others ask.
//! Computations whose callers have gone make room.
//!
//! **Invariant:** a computation that panics takes neither its worker nor anybody else's computation with it.

mod turns;

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use self::turns::{Place, Turns};
use super::work_clock;
use crate::actors::ConnectionId;
use crate::actors::gateway::budget::free_elsewhere;
use crate::actors::gateway::limits::MAX_CONNECTIONS;
use crate::actors::panics::contain;

/// How long one computation may keep a worker before the next one has its turn: short beside the 5 ms that a client
/// may be delayed, long beside the cost of changing over.
pub const SLICE: Duration = Duration::from_millis(1);

/// Computations that may be here at once, waiting or running: one of each connection.
pub const MAX_ADMITTED: usize = MAX_CONNECTIONS;
/// The refusal of one too many.
pub const BUSY: &str =
    "busy: as many computations of all clients wait as may wait; try again later";

/// The client for which a computation is done; none for the runtime's own.
pub type Owner = Option<ConnectionId>;
/// For whom the runtime's own computations are done.
pub const RUNTIME: Owner = None;

/// How often those that can't begin try again while nothing else is computed.
const TRY_AGAIN: Duration = Duration::from_millis(10);

/// Whether a computation wants another turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It waits for its next turn.
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

    /// True once nobody waits for the answer any more: it may be dropped.
    fn is_abandoned(&self) -> bool {
        false
    }

    /// Answers that the runtime is ending; the computation is dropped afterwards.
    fn refuse(&mut self, why: &'static str);
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

type Job = Box<dyn Computation>;

#[derive(Default)]
struct Queue {
    turns: Turns<Job>,
    /// Computations that can't begin yet.
    waiting: Vec<(Place, Job)>,
    closed: Option<&'static str>,
}

impl Queue {
    /// Takes out those for whose answers nobody waits.
    fn take_abandoned(&mut self) -> Vec<Job> {
        self.retry();
        self.turns.take_waiting_if(|job| job.is_abandoned())
    }

    /// Has those that could not begin try again.
    fn retry(&mut self) {
        for (place, job) in self.waiting.drain(..) {
            self.turns.wait(place, job);
        }
    }

    fn admitted(&self) -> usize {
        self.turns.len() + self.waiting.len()
    }
}

impl WorkerPool {
    /// Starts `threads` workers (at least one). They end with [`WorkerPool::close`].
    ///
    /// # Errors
    /// The operating system's, if it refuses a thread.
    pub fn start(threads: usize) -> std::io::Result<Self> {
        let pool = Self::without_threads();
        for number in 0..threads.max(1) {
            let shared = Arc::clone(&pool.shared);
            thread::Builder::new()
                .name(format!("worker-{number}"))
                .spawn(move || shared.work())?;
        }
        Ok(pool)
    }

    /// A pool without workers: whoever has it calls [`WorkerPool::turn`], as a simulation does, whose only thread is its own.
    #[must_use]
    pub fn without_threads() -> Self {
        let shared = Arc::new(Shared {
            queue: Mutex::default(),
            changed: Condvar::new(),
        });
        Self { shared }
    }

    /// Does one slice of the computation whose turn it is, in the calling thread; false if there is none. Those that could not
    /// begin try again when no other has its turn.
    #[must_use]
    pub fn turn(&self) -> bool {
        let next = {
            let mut queue = self.shared.lock();
            if queue.turns.waiting() == 0 {
                queue.retry();
            }
            queue.turns.next()
        };
        let Some((place, job)) = next else {
            return false;
        };
        self.shared.advance(place, job);
        true
    }

    /// One worker fewer than the machine has cores, so that the arm and the gateway keep one.
    #[must_use]
    pub fn default_threads() -> usize {
        thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).clamp(1, 4))
    }

    /// Takes in a computation for a client; refuses it if the pool is closed, or has as many as it may have. There is always room
    /// for the runtime's own.
    pub fn submit(&self, of: impl Into<Owner>, mut computation: Job) {
        let of = of.into();
        let why = {
            let mut queue = self.shared.lock();
            if queue.admitted() >= MAX_ADMITTED {
                // They may have many megabytes.
                free_elsewhere(queue.take_abandoned());
            }
            let has_room = of == RUNTIME || queue.admitted() < MAX_ADMITTED;
            if queue.closed.is_none() && has_room {
                queue.turns.enter(of, computation);
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
            queue.retry();
            queue.turns.take_waiting()
        };
        self.shared.changed.notify_all();
        for mut job in waiting {
            job.refuse(why);
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
        while let Some((place, job)) = self.take() {
            self.advance(place, job);
        }
    }

    /// Gives a computation that was taken its turn.
    fn advance(&self, place: Place, mut job: Job) {
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

    fn take(&self) -> Option<(Place, Job)> {
        let mut queue = self.lock();
        loop {
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
            let end;
            (queue, end) = waited.unwrap_or_else(PoisonError::into_inner);
            if end.timed_out() {
                queue.retry();
            }
        }
    }

    /// Takes a computation back after its turn; gives it out again, with what it is to be refused for, if it was its last.
    fn put_back(&self, place: Place, job: Job, progress: Progress, took: Duration) -> Option<End> {
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

    /// Ends a computation whose last turn began when this thread had had so much of a processor.
    fn end(&self, place: Place, End { mut job, why }: End, began: Duration) {
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

        fn is_abandoned(&self) -> bool {
            self.name == "gone"
        }

        fn refuse(&mut self, why: &'static str) {
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

    /// What has begun does not keep the worker, and each gets all the turns that it wants.
    #[test]
    fn computations_take_turns() {
        const TURNS: usize = 100;
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        {
            // Both wait before the worker takes the first: the lock is held meanwhile.
            let mut queue = pool.shared.lock();
            for (client, name) in [(1, "a"), (2, "b")] {
                let job = computation(name, TURNS, &log);
                queue.turns.enter(ConnectionId(client), job);
            }
        }
        pool.shared.changed.notify_all();
        let order: Vec<String> = seen.iter().take(2 * TURNS).collect();
        let a = order.iter().position(|turn| turn == "b").unwrap();
        let last_a = order.iter().rposition(|turn| turn == "a").unwrap();
        assert!(a < last_a, "b has a turn before the last of a: {order:?}");
        assert_eq!(order.iter().filter(|turn| *turn == "a").count(), TURNS);
        while !pool.is_idle() {
            thread::yield_now();
        }
    }

    /// Has a turn of five milliseconds, in which it computes or sleeps.
    struct Turn {
        sleeps: bool,
        log: mpsc::Sender<bool>,
    }

    impl Computation for Turn {
        fn advance(&mut self, _deadline: Instant) -> Progress {
            const TURN: Duration = Duration::from_millis(5);
            let before = work_clock::spent();
            if self.sleeps {
                thread::sleep(TURN);
            }
            while !self.sleeps && work_clock::spent() - before < TURN {
                std::hint::spin_loop();
            }
            self.log.send(self.sleeps).unwrap();
            Progress::Unfinished
        }

        fn refuse(&mut self, _why: &'static str) {}
    }

    /// Who sleeps in its turns has more of them: it is charged for what it has had of a processor.
    #[test]
    fn what_a_worker_was_kept_from_is_charged_to_nobody() {
        const TURNS: usize = 40;
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::without_threads();
        for (client, sleeps) in [(1, true), (2, false)] {
            let log = log.clone();
            pool.submit(ConnectionId(client), Box::new(Turn { sleeps, log }));
        }
        for _ in 0..TURNS {
            assert!(pool.turn());
        }
        let asleep = seen.try_iter().filter(|sleeps| *sleeps).count();
        assert!((TURNS * 3 / 4..TURNS).contains(&asleep), "{asleep}");
    }

    #[test]
    fn one_too_many_is_refused_and_there_is_always_room_for_the_runtimes_own() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        for client in 1..=MAX_ADMITTED as u64 {
            let endless = computation("endless", usize::MAX, &log);
            pool.submit(ConnectionId(client), endless);
        }
        let late = ConnectionId(MAX_ADMITTED as u64 + 1);
        pool.submit(late, computation("late", 1, &log));
        pool.submit(RUNTIME, computation("own", 1, &log));
        let mut refused = seen.iter().filter(|line| line != "endless");
        assert_eq!(refused.next(), Some(format!("late: {BUSY}")));
        assert_eq!(refused.next().as_deref(), Some("own"));
        pool.close("the test is over");
    }

    /// Abandoned ones make room, so that clients that come and go keep nobody out.
    #[test]
    fn who_comes_when_all_are_abandoned_is_admitted() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::without_threads();
        for client in 1..=MAX_ADMITTED as u64 {
            let gone = computation("gone", usize::MAX, &log);
            pool.submit(ConnectionId(client), gone);
        }
        pool.submit(
            ConnectionId(MAX_ADMITTED as u64 + 1),
            computation("newcomer", 1, &log),
        );
        assert!(pool.turn());
        assert_eq!(seen.try_recv().as_deref(), Ok("newcomer"));
        assert!(pool.is_idle(), "the others have been dropped");
        assert!(seen.try_recv().is_err());
    }

    #[test]
    fn a_panic_leaves_the_worker_working() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        pool.submit(ConnectionId(1), computation("panics", 1, &log));
        pool.submit(ConnectionId(2), computation("next", 1, &log));
        assert_eq!(seen.recv().unwrap(), "next");
    }

    #[test]
    fn a_closed_pool_refuses() {
        let (log, seen) = mpsc::channel();
        let pool = WorkerPool::start(1).unwrap();
        pool.close("shutting down");
        pool.submit(ConnectionId(1), computation("late", 1, &log));
        assert_eq!(seen.recv().unwrap(), "late: shutting down");
        assert!(pool.is_idle());
    }
}
