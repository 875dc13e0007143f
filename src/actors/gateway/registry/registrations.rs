//! The registry's entries of one client: registrations, and calls and goals that wait for other clients.
//!
//! **Invariant:** their sum is at most [`MAX_REGISTERED`] bytes. A dropped entry is subtracted.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;

use super::refusal::Refusal;
use crate::actors::gateway::limits::{ENTRY_BYTES, MAX_REGISTERED};
use crate::protocol::op::Served;

/// The sum of one client's entries \[bytes\]. Clones share it.
#[derive(Debug, Clone, Default)]
pub(super) struct EntrySum(Rc<Cell<usize>>);

/// One entry.
#[derive(Debug)]
pub(super) struct Entry {
    sum: EntrySum,
    bytes: usize,
}

/// The registrations of one client, sorted by name. They are withdrawn in that order.
#[derive(Default)]
pub(super) struct Registrations {
    pub(super) advertised: BTreeMap<Box<str>, Entry>,
    /// Topics of its subscriptions, in its own spelling.
    pub(super) subscribed: BTreeSet<Arc<str>>,
    pub(super) served: BTreeMap<(Served, Box<str>), Entry>,
}

impl EntrySum {
    /// Adds an entry whose names have `names` bytes. The caller drops `instead` next, so its bytes do not count towards
    /// the limit.
    pub(super) fn enter(&self, names: usize, instead: Option<&Entry>) -> Result<Entry, Refusal> {
        let bytes = ENTRY_BYTES.saturating_add(names.saturating_mul(3));
        let freed = instead.map_or(0, |entry| entry.bytes);
        let sum = self.0.get().saturating_add(bytes);
        if sum - freed > MAX_REGISTERED {
            return Err(Refusal::TooMuchRegistered);
        }
        self.0.set(sum);
        let sum = self.clone();
        Ok(Entry { sum, bytes })
    }
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.sum.0.set(self.sum.0.get() - self.bytes);
    }
}
