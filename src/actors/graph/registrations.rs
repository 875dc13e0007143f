//! The registry's entries of one client: registrations, and calls and goals that wait for other clients.
//!
//! **Invariant:** their sum is at most [`MAX_REGISTERED`] bytes. A dropped entry is subtracted.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;

use crate::protocol::op::Served;

/// Most bytes that the registry keeps of one connection: subscriptions, advertisements, services, and calls and goals
/// that wait for other clients.
pub const MAX_REGISTERED: usize = 128 * 1024;
/// Bytes of each entry in the tables, without three times its names.
pub const ENTRY_BYTES: usize = 640;

/// The client has too many registrations, calls and goals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "this connection keeps too much: its subscriptions, advertisements, services, and waiting calls and goals may take \
     {MAX_REGISTERED} bytes. Each takes {ENTRY_BYTES} bytes and three times its names and ids"
)]
pub struct TooMuchRegistered;

/// The sum of one client's entries \[bytes\]. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct EntrySum(Rc<Cell<usize>>);

/// One entry.
#[derive(Debug)]
pub struct Entry {
    sum: EntrySum,
    bytes: usize,
}

/// The registrations of one client, sorted by name. They are withdrawn in that order.
#[derive(Default)]
pub struct Registrations {
    /// Topics that it advertises, by their absolute names.
    pub advertised: BTreeMap<Box<str>, Entry>,
    /// Topics of its subscriptions, in its own spelling.
    pub subscribed: BTreeSet<Arc<str>>,
    /// Names that it serves.
    pub served: BTreeMap<(Served, Box<str>), Entry>,
}

impl EntrySum {
    /// Adds an entry whose names have `names` bytes. The caller drops `instead` next, so its bytes do not count towards
    /// the limit.
    ///
    /// # Errors
    /// If the sum would exceed [`MAX_REGISTERED`].
    pub fn enter(&self, names: usize, instead: Option<&Entry>) -> Result<Entry, TooMuchRegistered> {
        let bytes = ENTRY_BYTES.saturating_add(names.saturating_mul(3));
        let freed = instead.map_or(0, |entry| entry.bytes);
        let sum = self.0.get().saturating_add(bytes);
        if sum - freed > MAX_REGISTERED {
            return Err(TooMuchRegistered);
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
