//! The memory that clients use: bounded places times a bounded client, and three pools for long frames and answers.
//!
//! Short bytes have a bound in each connection (`gateway::limits`). An answer longer than [`SHORT`] takes a [`Permit`]
//! before it is computed, and keeps it until it has been written. A published message longer than [`MEDIUM`], and any
//! other frame longer than [`SHORT`], takes one while it is read, performed and forwarded. The client waits if no
//! permit is left. The permit stays with the bytes, and is released with their last copy.
//!
//! A permit is held for a bounded time, because other clients wait for it ([`time_to_read`]).
//!
//! **Invariant:** bytes longer than [`SHORT`] have a permit, except published messages of at most [`MEDIUM`], and the
//! frames of computations that wait in their own connection.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

pub use crate::protocol::limits::SHORT;
use crate::protocol::limits::{MAX_FRAME, MEDIUM};

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;

/// Most long frames that are read or performed at once. Frames that only wait to be written count by their bytes.
pub const LONG_FRAMES: usize = 3;
/// Most bytes of long answers at once, finished or being computed. Longer ones have [`LONGEST_ANSWER`].
pub const LONG_ANSWERS: usize = 16 * MIB;
/// The bytes for one answer longer than [`LONG_ANSWERS`]: a million steps. The next such answer waits.
pub const LONGEST_ANSWER: usize = 96 * MIB;
/// Bytes of short responses that may wait for one client. Above this limit, calls to it as a provider and answers to
/// its own calls are refused. The client is not read at half of it, but other clients could still send to it.
pub const MAX_BACKLOG: usize = 2 * SHORT;
/// The same for long calls and answers of other clients. The rest of the pool has room for a longest frame.
pub const MAX_LONG_BACKLOG: usize = 2 * MAX_FRAME;
const _: () = assert!(MAX_LONG_BACKLOG + MAX_FRAME <= LONG_FRAMES * MAX_FRAME);
/// Time for which bytes of any length may hold a permit while their client reads nothing.
pub const PERMIT_TIME: Duration = Duration::from_secs(20);
/// Timeout of a frame from its permit to its last byte. A longest frame has arrived by then at 1 MiB/s.
pub const LONG_FRAME_TIME: Duration = Duration::from_secs(5);
/// Bytes that a client must read per second of further time.
const READ_RATE: usize = MIB;
/// Bytes per permit of a semaphore.
const PART: usize = 16 * KIB;

/// Time in which a client must have read bytes that hold a permit, because other clients wait for it: [`PERMIT_TIME`],
/// and their length at 1 MiB/s.
#[must_use]
pub fn time_to_read(bytes: usize) -> Duration {
    PERMIT_TIME + Duration::from_millis((bytes / (READ_RATE / 1000)) as u64)
}

/// Bytes of memory that are taken in the order of the requests; clones share them.
#[derive(Debug, Clone)]
pub struct Pool {
    free: Arc<Semaphore>,
    parts: usize,
}

impl Pool {
    /// A pool of this number of bytes.
    #[must_use]
    pub fn of(bytes: usize) -> Self {
        let parts = bytes.div_ceil(PART).max(1);
        let free = Arc::new(Semaphore::new(parts));
        Self { free, parts }
    }

    /// Waits for this number of bytes, or for the whole pool if that is less. Once the pool is closed, it waits no
    /// more.
    async fn take(&self, bytes: usize) -> Permit {
        let taken = Arc::clone(&self.free).acquire_many_owned(self.needed(bytes));
        Permit::new(taken.await.ok())
    }

    /// The same, if it is free now.
    #[must_use]
    pub fn try_take(&self, bytes: usize) -> Option<Permit> {
        let taken = Arc::clone(&self.free).try_acquire_many_owned(self.needed(bytes));
        Some(Permit::new(Some(taken.ok()?)))
    }

    /// Whether this number of bytes is free.
    #[must_use]
    pub fn has(&self, bytes: usize) -> bool {
        self.free.available_permits() >= bytes.div_ceil(PART)
    }

    fn needed(&self, bytes: usize) -> u32 {
        u32::try_from(bytes.div_ceil(PART).min(self.parts)).unwrap_or(u32::MAX)
    }

    fn taken(&self) -> usize {
        (self.parts - self.free.available_permits()) * PART
    }
}

/// The pools; clones share them.
#[derive(Debug, Clone)]
pub struct Memory {
    frames: Pool,
    answers: Pool,
    longest: Pool,
}

impl Default for Memory {
    fn default() -> Self {
        Self::of(LONG_FRAMES, LONG_ANSWERS)
    }
}

impl Memory {
    /// Pools of `frames` longest frames, of `answers` bytes of long answers, and of one longer answer.
    #[must_use]
    pub fn of(frames: usize, answers: usize) -> Self {
        Self {
            frames: Pool::of(frames.max(1) * MAX_FRAME),
            answers: Pool::of(answers),
            longest: Pool::of(LONGEST_ANSWER),
        }
    }

    /// Waits for the permit for a long frame of any length. Permits are granted in the order of the requests.
    pub async fn long_frame(&self) -> Permit {
        self.frames.take(MAX_FRAME).await
    }

    /// Waits for the permit for an answer of at most `bytes` bytes. Permits are granted in the order of the requests.
    /// An answer longer than the pool of answers waits only for others of its kind.
    pub async fn answer(&self, bytes: usize) -> Permit {
        if bytes.div_ceil(PART) > self.answers.parts {
            self.longest.take(LONGEST_ANSWER).await
        } else {
            self.answers.take(bytes).await
        }
    }

    /// No answer waits from now on, because the runtime is ending.
    pub fn close(&self) {
        self.answers.free.close();
        self.longest.free.close();
    }

    /// The bytes for which permits are held.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.frames.taken() + self.answers.taken() + self.longest.taken()
    }
}

/// The permit for a long frame or a long answer, until its last clone is dropped.
#[derive(Debug, Clone)]
pub struct Permit(Arc<Taken>);

#[derive(Debug)]
struct Taken {
    permit: Mutex<Option<OwnedSemaphorePermit>>,
    /// The bytes that it covers.
    covered: AtomicUsize,
}

impl Permit {
    fn new(permit: Option<OwnedSemaphorePermit>) -> Self {
        Self(Arc::new(Taken {
            permit: Mutex::new(permit),
            covered: AtomicUsize::new(0),
        }))
    }

    /// Covers this number of further bytes.
    pub fn add(&self, bytes: usize) {
        self.0.covered.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Gives back the part of it that the covered bytes do not need. The frame has been performed, and only these bytes
    /// are left of it.
    pub fn trim(&self) {
        let needed = self.0.covered.load(Ordering::Relaxed).div_ceil(PART);
        let mut permit = self.0.permit.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(permit) = permit.as_mut() {
            drop(permit.split(permit.num_permits().saturating_sub(needed)));
        }
    }
}

/// Attaches the permit, if there is one, to these bytes, if they are long.
#[must_use]
pub fn cover(permit: Option<&Permit>, bytes: Bytes) -> Bytes {
    match permit.filter(|_| bytes.len() > SHORT) {
        Some(permit) => {
            permit.add(bytes.len());
            Bytes::from_owner(Covered {
                bytes,
                _permit: permit.clone(),
            })
        }
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

    fn granted<T>(wait: impl Future<Output = T>) -> (Option<T>, impl Future<Output = T>) {
        let mut wait = Box::pin(wait);
        let mut cx = std::task::Context::from_waker(std::task::Waker::noop());
        let now = match wait.as_mut().poll(&mut cx) {
            Poll::Ready(permit) => Some(permit),
            Poll::Pending => None,
        };
        (now, wait)
    }

    #[test]
    fn answers_wait_in_order_and_the_longest_waits_only_for_its_kind() {
        let memory = Memory::of(1, MIB);
        let (half, _) = granted(memory.answer(MIB / 2));
        let (longest, _) = granted(memory.answer(MIB + 1));
        assert!(half.is_some() && longest.is_some());
        let (whole, second) = granted(memory.answer(MIB));
        let (small, third) = granted(memory.answer(1));
        assert!(whole.is_none() && small.is_none(), "nothing overtakes");
        let (another, fourth) = granted(memory.answer(usize::MAX));
        assert!(another.is_none());
        drop(half);
        let (whole, _) = granted(second);
        drop(longest);
        assert!(whole.is_some() && granted(fourth).0.is_some());
        drop(whole);
        assert!(granted(third).0.is_some());
        assert_eq!(memory.taken(), 0);
        let (_all, _) = granted(memory.answer(MIB));
        let (waits, wait) = granted(memory.answer(MIB));
        memory.close();
        assert!(waits.is_none() && granted(wait).0.is_some());
    }

    #[test]
    fn long_frames_wait_for_one_another_and_keep_only_the_bytes_that_are_left() {
        let memory = Memory::of(1, MIB);
        let (first, _) = granted(memory.long_frame());
        let (second, wait) = granted(memory.long_frame());
        assert!(second.is_none());
        let first = first.expect("there is room");
        let bytes = cover(Some(&first), vec![0; MIB].into());
        first.trim();
        assert_eq!(
            memory.taken(),
            MAX_FRAME,
            "the rest is reserved for the second"
        );
        drop((first, bytes));
        assert!(granted(wait).0.is_some());
        assert_eq!(memory.taken(), 0);
    }
}
