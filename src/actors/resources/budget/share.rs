//! Shares of an account, and the frames that they go with.
//!
//! **Invariant:** it is given back once, when the memory has been freed.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use bytes::Bytes;
use tokio::runtime::Handle;

use super::account::{Account, Sum};
use super::{MODEST_PART, NoRoom};
use crate::actors::resources::work_clock;
use crate::protocol::outbox::FRAME_BYTES;

/// Freeing more bytes than this at once takes milliseconds: a thread that nobody waits for does it.
const LARGE: usize = 4 * 1024 * 1024;

impl Account {
    /// Takes `bytes` until the share is dropped.
    #[must_use]
    pub fn take(self: &Arc<Self>, bytes: usize) -> Share {
        self.add(bytes);
        Share::noted(self, bytes)
    }

    /// Counts a frame, and what there is beside its bytes, until the last copy of it is gone.
    #[must_use]
    pub fn count(self: &Arc<Self>, frame: Bytes) -> Bytes {
        self.take(frame.len() + FRAME_BYTES).cover(frame)
    }

    /// The topic messages that wait for the client are to be freed elsewhere: until that is done, nobody else has to
    /// give way for them.
    #[must_use]
    pub fn freeing(&self) -> Freed {
        Freed::of(&self.sum, self.shared.load(Ordering::Relaxed))
    }

    /// Reserves `bytes` for an answer that is to be computed. An eighth of the limit is kept for what needs no promise,
    /// and another eighth for answers of at most one part in [`MODEST_PART`] of the limit, so that they find room
    /// beside any number of long ones.
    ///
    /// # Errors
    /// If there is no room. Says whether some can be expected: computations of others end soon, messages that
    /// clients do not read may stay. With `is_out_of_patience` there is room if somebody holds more than this client
    /// would: that one gives way.
    pub fn promise(
        self: &Arc<Self>,
        bytes: usize,
        is_out_of_patience: bool,
    ) -> Result<Promise, NoRoom> {
        let sum = &self.sum;
        let eighths = if bytes > sum.limit / MODEST_PART {
            6
        } else {
            7
        };
        let most = sum.limit / 8 * eighths;
        // First, so that whoever finds no room because of this one sees a promise, not an answer that nobody reads.
        sum.promised.fetch_add(bytes, Ordering::SeqCst);
        let add = |held: usize| held.checked_add(bytes).filter(|all| *all <= most);
        let ordering = Ordering::SeqCst;
        if sum.held.fetch_update(ordering, ordering, add).is_ok() {
            self.own.fetch_add(bytes, Ordering::Relaxed);
            return Ok(Promise::of(Share::noted(self, bytes)));
        }
        let promised = sum.promised.fetch_sub(bytes, Ordering::SeqCst) - bytes;
        let leaving = sum.leaving(&sum.open());
        let held = sum.held.load(Ordering::SeqCst);
        let waiting = held.saturating_sub(promised).saturating_sub(leaving);
        if waiting.saturating_add(bytes) <= most {
            return Err(NoRoom::Yet);
        }
        if is_out_of_patience && sum.anyone_holds_over(self.held().saturating_add(bytes)) {
            sum.promised.fetch_add(bytes, Ordering::SeqCst);
            return Ok(Promise::of(self.take(bytes)));
        }
        Err(NoRoom::Now)
    }
}

/// Bytes taken from an account, given back when this is dropped.
#[derive(Debug)]
pub struct Share {
    account: Arc<Account>,
    bytes: usize,
}

impl Share {
    /// A share of bytes that the account has been charged for.
    pub(super) fn noted(account: &Arc<Account>, bytes: usize) -> Self {
        let account = Arc::clone(account);
        Self { account, bytes }
    }

    /// Bytes taken.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Makes it `bytes`.
    pub fn resize(&mut self, bytes: usize) {
        if bytes > self.bytes {
            self.account.add(bytes - self.bytes);
        } else {
            self.account.give_back(self.bytes - bytes);
        }
        self.bytes = bytes;
    }

    /// The share goes with the frame: it is given back when the last copy of that is gone.
    #[must_use]
    pub fn cover(self, frame: Bytes) -> Bytes {
        Bytes::from_owner(CountedFrame {
            frame,
            share: Some(self),
        })
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.account.give_back(self.bytes);
    }
}

/// Bytes taken for an answer that is being computed.
#[derive(Debug)]
pub struct Promise {
    share: Share,
    promised: usize,
}

impl Promise {
    pub(super) fn of(share: Share) -> Self {
        let promised = share.bytes;
        Self { share, promised }
    }

    /// The answer is there: what it does not need of what was promised is given back.
    #[must_use]
    pub fn cover(mut self, frame: Bytes) -> Bytes {
        let nothing = Share::noted(&self.share.account, 0);
        let mut share = std::mem::replace(&mut self.share, nothing);
        share.resize(frame.len() + FRAME_BYTES);
        share.cover(frame)
    }
}

impl Drop for Promise {
    fn drop(&mut self) {
        let promised = &self.share.account.sum.promised;
        promised.fetch_sub(self.promised, Ordering::SeqCst);
    }
}

/// Topic messages of a client that is gone, on their way to where they are freed: to be dropped behind them.
#[derive(Debug)]
pub struct Freed {
    sum: Arc<Sum>,
    bytes: usize,
}

impl Freed {
    pub(super) fn of(sum: &Arc<Sum>, bytes: usize) -> Self {
        sum.freed.fetch_add(bytes, Ordering::Relaxed);
        let sum = Arc::clone(sum);
        Self { sum, bytes }
    }
}

impl Drop for Freed {
    fn drop(&mut self) {
        self.sum.freed.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// A frame and what was taken for it.
struct CountedFrame {
    frame: Bytes,
    share: Option<Share>,
}

impl AsRef<[u8]> for CountedFrame {
    fn as_ref(&self) -> &[u8] {
        &self.frame
    }
}

impl Drop for CountedFrame {
    fn drop(&mut self) {
        if self.frame.len() > LARGE {
            let counted = (std::mem::take(&mut self.frame), self.share.take());
            free_elsewhere(counted);
        }
    }
}

/// Drops what takes milliseconds to free where nobody waits for it; a simulation has nowhere else.
pub fn free_elsewhere<T: Send + 'static>(large: T) {
    match Handle::try_current() {
        Ok(runtime) if !work_clock::is_counted() => {
            drop(runtime.spawn_blocking(move || drop(large)));
        }
        _ => drop(large),
    }
}
