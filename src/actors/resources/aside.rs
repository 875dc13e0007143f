//! Work that would keep the gateway's thread for longer than a turn, done on another thread meanwhile.
//!
//! The gateway's thread serves every client: nothing holds it for much more than a millisecond. Long work that needs
//! nothing but its bytes and that one client waits for is done here. Examples are a frame of megabytes to be read, a
//! message to be encoded, and a long list to be written.
//!
//! **Invariant:** at most [`PLACES`] of these threads are at work for one gateway on each kind of errand; the others
//! wait in the order in which they came.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::{spawn_blocking, yield_now};

use crate::actors::panics::contain;
use crate::actors::resources::work_clock;
use crate::protocol::limits::MEDIUM;

/// Threads at work at once on each kind of errand: one that has megabytes to do holds up no other.
pub const PLACES: usize = 2;

/// The kinds of errands. Each has places of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkKind {
    /// Reads a client's input.
    Reading,
    /// The same with more than [`MEDIUM`]. Long ones have places of their own, so that shorter work waits for
    /// less.
    ReadingLong,
    /// Writes messages in the forms that clients ask for.
    Writing,
    /// The same with more than [`MEDIUM`].
    WritingLong,
    /// Writes long lists that clients ask for: a client that encodes messages without end delays no
    /// question.
    Listing,
}

impl WorkKind {
    /// Reads that many bytes of a client's input.
    #[must_use]
    pub const fn reading(bytes: usize) -> Self {
        if bytes > MEDIUM {
            Self::ReadingLong
        } else {
            Self::Reading
        }
    }

    /// Writes a message of that many bytes in another form.
    #[must_use]
    pub const fn writing(bytes: usize) -> Self {
        if bytes > MEDIUM {
            Self::WritingLong
        } else {
            Self::Writing
        }
    }
}

thread_local! {
    static READING: Arc<Semaphore> = Arc::new(Semaphore::new(PLACES));
    static READING_LONG: Arc<Semaphore> = Arc::new(Semaphore::new(PLACES));
    static WRITING: Arc<Semaphore> = Arc::new(Semaphore::new(PLACES));
    static WRITING_LONG: Arc<Semaphore> = Arc::new(Semaphore::new(PLACES));
    static LISTING: Arc<Semaphore> = Arc::new(Semaphore::new(PLACES));
}

/// A place among those who are at work on one kind of errand.
pub struct WorkPermit(OwnedSemaphorePermit);

impl WorkPermit {
    /// A place, once one is free: for work that is to take nothing while it waits. `None` if the runtime is ending.
    pub async fn take(errand: WorkKind) -> Option<Self> {
        let free = match errand {
            WorkKind::Reading => READING.with(Arc::clone),
            WorkKind::ReadingLong => READING_LONG.with(Arc::clone),
            WorkKind::Writing => WRITING.with(Arc::clone),
            WorkKind::WritingLong => WRITING_LONG.with(Arc::clone),
            WorkKind::Listing => LISTING.with(Arc::clone),
        };
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
    errand: WorkKind,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    WorkPermit::take(errand).await?.perform(work).await
}
