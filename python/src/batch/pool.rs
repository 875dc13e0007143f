//! The threads that batches share.
//!
//! **Invariant:** a thread belongs to the process that asks for it.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::PyResult;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::fields::refused;

/// Threads by how many there are, of this process: a forked child has none of its parent's.
static POOLS: Mutex<Vec<(u32, usize, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// The threads that share the work; none for one alone.
pub(super) fn pool(threads: usize) -> PyResult<Option<Arc<ThreadPool>>> {
    if threads == 1 {
        return Ok(None);
    }
    let process = std::process::id();
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((.., pool)) = pools
        .iter()
        .find(|(of, size, _)| (*of, *size) == (process, threads))
    {
        return Ok(Some(Arc::clone(pool)));
    }
    let pool = Arc::new(
        ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(refused)?,
    );
    pools.push((process, threads, Arc::clone(&pool)));
    Ok(Some(pool))
}
