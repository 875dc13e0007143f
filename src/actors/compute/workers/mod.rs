//! A few threads that do the heavy requests in turns, so that no client waits for another's million steps.
//!
//! A computation is advanced for one slice and waits for its next turn. The turn goes to the client that has had least
//! of the workers' processor time (`workers/turns.rs`); time that a busy machine takes from a worker is charged to
//! nobody. A connection has at most one computation here at a time (the rest wait in the connection), so each
//! connection gets the same share, and one that asks for little does not wait for those that ask for much. The memory
//! of a computation is counted when room is taken for its answer
//! ([`Reply::reserve`](crate::actors::node::Reply::reserve)).
//!
//! At most [`MAX_ADMITTED`] computations are here at once, one for every possible connection: nobody is refused because
//! of what others ask. Computations whose callers have gone make room.
//!
//! **Invariant:** a computation that panics takes neither its worker nor anybody else's computation with it.

mod computation;
mod queue;
mod turns;

use std::sync::Arc;
use std::thread;

pub use self::computation::{Computation, Progress, SLICE};
use self::queue::{Job, PoolState};
pub use self::turns::{Owner, RUNTIME};
use crate::actors::gateway::limits::MAX_CONNECTIONS;
use crate::actors::resources::budget::free_elsewhere;
use crate::actors::resources::priority::give_way;

/// Computations that may be here at once, waiting or running: one of each connection.
pub const MAX_ADMITTED: usize = MAX_CONNECTIONS;
/// The refusal when there are too many computations.
pub const BUSY: &str =
    "busy: as many computations of all clients wait as may wait; try again later";

/// A handle on the pool; clones share it.
#[derive(Clone)]
pub struct WorkerPool {
    shared: Arc<PoolState>,
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
                .spawn(move || {
                    give_way();
                    shared.work();
                })?;
        }
        Ok(pool)
    }

    /// A pool without workers, whose owner calls [`WorkerPool::turn`]. It is for a simulation that has one thread only.
    #[must_use]
    pub fn without_threads() -> Self {
        let shared = Arc::default();
        Self { shared }
    }

    /// Does one slice of the computation whose turn it is, in the calling thread; false if there is none. Those that
    /// could not begin try again when no other has its turn.
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

    /// Takes in a computation for a client; refuses it if the pool is closed, or has as many as it may have. There is
    /// always room for the runtime's own.
    pub fn submit(&self, of: impl Into<Owner>, mut computation: Job) {
        let of = of.into();
        let why = {
            let mut queue = self.shared.lock();
            if queue.admitted() >= MAX_ADMITTED {
                // The abandoned computations may have many megabytes.
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

#[cfg(test)]
mod tests;
