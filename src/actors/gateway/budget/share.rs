//! What is taken from an account, and the frames that it goes with.
//!
//! **Invariant:** it is given back once, when the memory has been freed.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use bytes::Bytes;
use tokio::runtime::Handle;

use super::{Account, Sum};
use crate::actors::compute::work_clock;
use crate::protocol::outbox::FRAME_BYTES;

/// Freeing more bytes than this at once takes milliseconds: a thread that nobody waits for does it.
const LARGE: usize = 4 * 1024 * 1024;

/// Bytes taken from an account, given back when this is dropped.
#[derive(Debug)]
pub struct Share {
    account: Arc<Account>,
    bytes: usize,
}

impl Share {
    /// Of bytes that the account has been charged for.
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
        Bytes::from_owner(Counted {
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
struct Counted {
    frame: Bytes,
    share: Option<Share>,
}

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.frame
    }
}

impl Drop for Counted {
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
