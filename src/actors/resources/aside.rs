//! Work that would keep the gateway's thread for longer than a turn, done on another thread meanwhile.
//!
//! The gateway's thread serves every client: nothing holds it for much more than a millisecond. Long work that needs
//! nothing but its bytes and that one client waits for is done here. Examples are a frame of megabytes to be read, a
//! message to be encoded, and a long list to be written.
//!
//! **Invariant:** at most [`PLACES`] of these threads are at work for one gateway on each kind of work. The others wait
//! in the order in which they came.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::{spawn_blocking, yield_now};

use crate::actors::panics::contain;
use crate::actors::resources::work_clock;
use crate::protocol::limits::MEDIUM;

/// Threads at work at once on each kind of work.
pub const PLACES: usize = 2;

/// The kinds of work. Each has places of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkKind {
    /// Reads a frame or encodes a message.
    Usual,
    /// The same with more than [`MEDIUM`]: shorter work does not wait for it.
    Long,
    /// Writes a long list. It keeps its place while it waits for the room of its answer.
    Listing,
}

impl WorkKind {
    /// Reads or encodes that many bytes.
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
    static FREE: [Arc<Semaphore>; 3] = std::array::from_fn(|_| Arc::new(Semaphore::new(PLACES)));
}

/// A place for one kind of work.
pub struct WorkPermit(OwnedSemaphorePermit);

impl WorkPermit {
    /// A place, once one is free: for work that is to take nothing while it waits. `None` if the runtime is ending.
    pub async fn take(kind: WorkKind) -> Option<Self> {
        let free = FREE.with(|free| free.get(kind as usize).map(Arc::clone))?;
        free.acquire_owned().await.ok().map(Self)
    }

    /// Does `work` on another thread; in a simulation, which has one, on that and a turn later. `None` if it panicked,
    /// which is logged, or if the runtime is ending.
    pub async fn perform<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let Self(place) = self;
        let work = move || {
            let done = contain(work);
            drop(place);
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

/// Waits for a place and does `work` there.
pub async fn aside<T: Send + 'static>(
    kind: WorkKind,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    WorkPermit::take(kind).await?.perform(work).await
}
