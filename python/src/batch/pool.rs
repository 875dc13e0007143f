//! The threads that batches share.
//!
//! **Invariant:** a thread belongs to the process that requests it.

use std::iter;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// A process, its requested number of threads, and its threads; `None` if the system refused all.
type Kept = (u32, usize, Option<Arc<ThreadPool>>);

/// The pools of this process, because a forked child has none of its parent's threads. The last used ones
/// are at the end.
static POOLS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// The number of pools that are kept, the last used ones. Others end with their call.
const MOST_KEPT: usize = 4;

/// Bytes of a thread's stack, as the main thread has them. A build without optimisation needs more than the usual 2 MiB.
const STACK: usize = 8 << 20;

/// The threads that share the work, or fewer if the system refuses some; `None` for one thread.
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
    // A parent's threads are not dropped, because they do not exist in the child.
    let own = |(of, ..): &Kept| *of == process;
    if pools.iter().filter(|one| own(one)).count() > MOST_KEPT
        && let Some(oldest) = pools.iter().position(own)
    {
        pools.remove(oldest);
    }
    pool
}

/// As many threads as the system allows, up to `threads`. Their number does not change results.
fn started(threads: usize) -> Option<Arc<ThreadPool>> {
    let fewer = iter::successors(Some(threads), |count| Some(count / 2));
    fewer.take_while(|&count| count > 1).find_map(|count| {
        let threads = ThreadPoolBuilder::new()
            .num_threads(count)
            .stack_size(STACK);
        threads.build().ok().map(Arc::new)
    })
}
