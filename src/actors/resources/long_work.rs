//! Runs long work of the gateway on other threads.
//!
//! The gateway's thread serves every client, so no work may block it for much more than a millisecond. Long work for
//! one client that needs only its own bytes is done here. Examples are reading a frame of megabytes, encoding a
//! message, and writing a long list.
//!
//! **Invariant:** at most [`THREADS_OF_A_KIND`] threads of one gateway work on each kind of work. Further work waits in order.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::{spawn_blocking, yield_now};

use crate::actors::panics::contain;
use crate::actors::resources::work_clock;
use crate::protocol::limits::MEDIUM;

/// Longest frame that is parsed on the gateway's thread, and longest message of a client that is encoded there in a form
/// other than plain JSON \[bytes\]. Either takes about a tenth of a millisecond. All clients may have such work at once,
/// and a light call waits for all of it.
pub const SHORT_WORK: usize = 16 * 1024;
/// Most active threads for each kind of work.
pub const THREADS_OF_A_KIND: usize = 2;
const KINDS: usize = 3;
/// All threads, so that no kind of work waits for another.
pub const THREADS: usize = KINDS * THREADS_OF_A_KIND;

/// The kinds of work. Each has its own threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkKind {
    /// Reads a frame or encodes a message.
    Usual,
    /// The same for more than [`MEDIUM`] bytes. Shorter work has threads of its own.
    Long,
    /// Writes a long list.
    Listing,
}

impl WorkKind {
    /// The kind for reading or encoding this number of bytes.
    #[must_use]
    pub const fn of(bytes: usize) -> Self {
        if bytes > MEDIUM {
            Self::Long
        } else {
            Self::Usual
        }
    }
}

thread_local! {
    static FREE: [Arc<Semaphore>; KINDS] = std::array::from_fn(|_| Arc::new(Semaphore::new(THREADS_OF_A_KIND)));
}

/// The right to a thread for one kind of work.
pub struct WorkPermit(OwnedSemaphorePermit);

impl WorkPermit {
    /// Waits for a free thread, for work that uses no memory while it waits. `None` if the runtime is ending.
    pub async fn take(kind: WorkKind) -> Option<Self> {
        let free = FREE.with(|free| free.get(kind as usize).map(Arc::clone))?;
        free.acquire_owned().await.ok().map(Self)
    }

    /// Runs `work` on another thread, or one turn later on the same thread in a simulation, which has only one. `None`
    /// after a panic, which is logged, or if the runtime is ending.
    pub async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let Self(permit) = self;
        let work = move || {
            let done = contain(work);
            drop(permit);
            done
        };
        let done = if work_clock::is_counted() {
            yield_now().await;
            work()
        } else {
            spawn_blocking(work).await.ok()?
        };
        match done {
            Ok(done) => Some(done),
            Err(panic) => {
                tracing::error!(%panic, "work for a client failed");
                None
            }
        }
    }
}

/// Waits for a free thread and runs `work` there.
pub async fn run_long_work<T: Send + 'static>(
    kind: WorkKind,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    WorkPermit::take(kind).await?.run(work).await
}
