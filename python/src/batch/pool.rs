//! The threads that batches share.
//!
//! **Invariant:** a thread belongs to the process that asks for it.

use std::iter;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// A process, how many threads it asked for, and those that it got; `None` where the system gave none.
type Kept = (u32, usize, Option<Arc<ThreadPool>>);

/// The pools of this process: a forked child has none of its parent's threads. The latest used come last.
static POOLS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// Numbers of threads that are kept ready, the latest that were used; others end with the call that uses them.
const MOST_KEPT: usize = 4;

/// The threads that share the work, or fewer where the system has no more of them; none for one alone.
pub(super) fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    if threads == 1 {
        return None;
    }
    let process = std::process::id();
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = pools
        .iter()
        .position(|(of, size, _)| (*of, *size) == (process, threads));
    let pool = match known {
        Some(place) => pools.remove(place).2,
        None => started(threads),
    };
    pools.push((process, threads, pool.clone()));
    // A parent's threads are left as they are: in the child nobody is there to end them.
    let own = |(of, ..): &Kept| *of == process;
    if pools.iter().filter(|one| own(one)).count() > MOST_KEPT
        && let Some(oldest) = pools.iter().position(own)
    {
        pools.remove(oldest);
    }
    pool
}

/// As many threads as the system has, up to `threads`. The number of threads changes no result.
fn started(threads: usize) -> Option<Arc<ThreadPool>> {
    let fewer = iter::successors(Some(threads), |count| Some(count / 2));
    fewer.take_while(|&count| count > 1).find_map(|count| {
        let pool = ThreadPoolBuilder::new().num_threads(count).build();
        pool.ok().map(Arc::new)
    })
}
