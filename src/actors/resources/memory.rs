//! The memory that clients use: bounded places times a bounded client, and two pools for long frames and answers.
//!
//! Short bytes have a bound in each connection (`gateway::limits`). An answer longer than [`SHORT`] takes a [`Permit`]
//! before it is computed, and keeps it until it has been written. A published message longer than [`MEDIUM`], and any
//! other frame longer than [`SHORT`], takes one while it is read, performed and forwarded. The client waits if no
//! permit is left. The permit stays with the bytes, and is released with their last copy.
//!
//! **Invariant:** bytes longer than [`SHORT`] have a permit, except published messages of at most [`MEDIUM`].

use std::sync::Arc;

use bytes::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::protocol::limits::MEDIUM;
pub use crate::protocol::limits::SHORT;

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;

/// Most long frames at once.
pub const LONG_FRAMES: usize = 3;
/// Most bytes of long answers at once, finished or being computed: one of a million steps, or many of ten thousand.
pub const LONG_ANSWERS: usize = 96 * MIB;
/// Bytes of short responses that may wait for one client. Above this limit, calls to it as a provider and answers to
/// its own calls are refused. The client is not read at half of it, but other clients could still send to it.
pub const MAX_BACKLOG: usize = 2 * SHORT;
/// The bytes of an answer per permit of the pool.
const ANSWER_PART: usize = 16 * KIB;

/// The two pools; clones share them.
#[derive(Debug, Clone)]
pub struct Memory {
    frames: Arc<Semaphore>,
    answers: Arc<Semaphore>,
    size: (usize, usize),
}

impl Default for Memory {
    fn default() -> Self {
        Self::of(LONG_FRAMES, LONG_ANSWERS)
    }
}

impl Memory {
    /// Pools of `frames` long frames and of `answers` bytes of long answers.
    #[must_use]
    pub fn of(frames: usize, answers: usize) -> Self {
        let size = (frames.max(1), answers.div_ceil(ANSWER_PART).max(1));
        Self {
            frames: Arc::new(Semaphore::new(size.0)),
            answers: Arc::new(Semaphore::new(size.1)),
            size,
        }
    }

    /// Waits for the permit for a long frame. Permits are granted in the order of the requests.
    pub async fn long_frame(&self) -> Permit {
        let permit = Arc::clone(&self.frames).acquire_owned().await;
        Permit::new(permit.ok())
    }

    /// The permit for an answer of at most `bytes` bytes, if there is enough memory now. The longest answer fits
    /// once all others have been written.
    #[must_use]
    pub fn answer(&self, bytes: usize) -> Option<Permit> {
        let parts = bytes.div_ceil(ANSWER_PART).min(self.size.1);
        let parts = u32::try_from(parts).unwrap_or(u32::MAX);
        let permit = Arc::clone(&self.answers).try_acquire_many_owned(parts);
        Some(Permit::new(Some(permit.ok()?)))
    }

    /// The number of taken permits of both pools.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.size.0 + self.size.1
            - self.frames.available_permits()
            - self.answers.available_permits()
    }
}

/// The permit for a long frame or a long answer, until its last clone is dropped.
#[derive(Debug, Clone)]
pub struct Permit {
    _taken: Arc<Option<OwnedSemaphorePermit>>,
}

impl Permit {
    fn new(permit: Option<OwnedSemaphorePermit>) -> Self {
        let _taken = Arc::new(permit);
        Self { _taken }
    }
}

/// Attaches the permit, if there is one, to these bytes, if they are long.
#[must_use]
pub fn cover(permit: Option<&Permit>, bytes: Bytes) -> Bytes {
    match permit.filter(|_| bytes.len() > SHORT) {
        Some(permit) => Bytes::from_owner(Covered {
            bytes,
            _permit: permit.clone(),
        }),
        None => bytes,
    }
}

/// The same for a topic message, which needs no permit up to [`MEDIUM`].
#[must_use]
pub fn cover_message(permit: Option<&Permit>, bytes: Bytes) -> Bytes {
    let permit = permit.filter(|_| bytes.len() > MEDIUM);
    cover(permit, bytes)
}

/// Bytes, and the permit for them.
struct Covered {
    bytes: Bytes,
    _permit: Permit,
}

impl AsRef<[u8]> for Covered {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

#[cfg(test)]
mod tests {
    use std::task::Poll;

    use super::*;

    #[test]
    fn an_answer_longer_than_the_pool_has_it_alone() {
        let memory = Memory::of(1, MIB);
        let longest = memory.answer(usize::MAX).unwrap();
        assert!(memory.answer(1).is_none());
        drop(longest);
        assert!(memory.answer(1).is_some());
    }

    #[test]
    fn long_frames_wait_for_one_another() {
        let mut cx = std::task::Context::from_waker(std::task::Waker::noop());
        let memory = Memory::of(1, MIB);
        let mut first = Box::pin(memory.long_frame());
        let mut second = Box::pin(memory.long_frame());
        let Poll::Ready(permit) = first.as_mut().poll(&mut cx) else {
            panic!("there is room");
        };
        assert!(second.as_mut().poll(&mut cx).is_pending());
        drop(permit);
        assert!(second.as_mut().poll(&mut cx).is_ready());
        assert_eq!(memory.taken(), 0);
    }
}
