//! All accounts, and their sum.
//!
//! **Invariant:** an account is in the list for as long as anybody has it.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use bytes::Bytes;

use super::account::{Account, Sum};
use super::share::Share;
use super::{CONNECTION_BYTES, MAX_HELD};

/// All accounts, and their sum; clones share them.
#[derive(Clone)]
pub struct Memory {
    sum: Arc<Sum>,
    /// Messages, each once: nobody's own.
    messages: Arc<Account>,
}

impl Default for Memory {
    fn default() -> Self {
        Self::of(MAX_HELD)
    }
}

impl Memory {
    /// Nothing is held, and at most `limit` bytes may be.
    #[must_use]
    pub fn of(limit: usize) -> Self {
        let sum = Arc::new(Sum::of(limit));
        let messages = Arc::new(Account::new(Arc::clone(&sum)));
        Self { sum, messages }
    }

    /// Bytes held.
    #[must_use]
    pub fn held(&self) -> usize {
        self.sum.held.load(Ordering::Relaxed)
    }

    /// Connections that were ended since the start because they held the most.
    #[must_use]
    pub fn cut_off(&self) -> u64 {
        self.sum.cut_off.load(Ordering::Relaxed)
    }

    /// Opens the account of a connection, which is charged for that much.
    #[must_use]
    pub fn open(&self) -> Arc<Account> {
        let account = Arc::new(Account::new(Arc::clone(&self.sum)));
        {
            let mut accounts = self.sum.accounts();
            accounts.retain(|one| one.strong_count() > 0);
            accounts.push(Arc::downgrade(&account));
        }
        account.add(CONNECTION_BYTES);
        account
    }

    /// Counts a topic message, which may be shared, until its last copy is gone.
    #[must_use]
    pub fn count(&self, frame: Bytes) -> Bytes {
        self.messages.count(frame)
    }

    /// Takes `bytes` for work that is nobody's own, until the share is dropped.
    #[must_use]
    pub fn take(&self, bytes: usize) -> Share {
        self.messages.take(bytes)
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.held(), self.sum.limit)
    }
}
