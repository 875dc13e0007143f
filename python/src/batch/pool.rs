//! The threads that batches share.
//!
//! **Invariant:** a thread belongs to the process that asks for it.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::PyResult;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::fields::refused;

/// Threads by how many there are, of this process: a forked child has none of its parent's. The latest used come last.
static POOLS: Mutex<Vec<(u32, usize, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// Numbers of threads that are kept ready, the latest that were used; others end with the call that uses them.
const MOST_KEPT: usize = 4;

/// The threads that share the work; none for one alone.
pub(super) fn pool(threads: usize) -> PyResult<Option<Arc<ThreadPool>>> {
    if threads == 1 {
        return Ok(None);
    }
    let process = std::process::id();
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = pools
        .iter()
        .position(|(of, size, _)| (*of, *size) == (process, threads));
    let pool = match known {
        Some(place) => pools.remove(place).2,
        None => Arc::new(
            ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map_err(refused)?,
        ),
    };
    pools.push((process, threads, Arc::clone(&pool)));
    // A parent's threads are left as they are: in the child nobody is there to end them.
    let own = |(of, ..): &(u32, usize, Arc<ThreadPool>)| *of == process;
    if pools.iter().filter(|one| own(one)).count() > MOST_KEPT
        && let Some(oldest) = pools.iter().position(own)
    {
        pools.remove(oldest);
    }
    Ok(Some(pool))
}
