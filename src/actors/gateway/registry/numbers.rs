//! Numbers of what is on its way, by the client whom it concerns.
//!
//! **Invariant:** who goes costs no search through what concerns the others.

use std::collections::{BTreeSet, HashMap};

use crate::actors::ConnectionId;

/// Numbers of calls, or of goals, by client.
#[derive(Default)]
pub(super) struct Numbers(HashMap<ConnectionId, BTreeSet<u64>>);

impl Numbers {
    pub(super) fn add(&mut self, client: ConnectionId, number: u64) {
        self.0.entry(client).or_default().insert(number);
    }

    pub(super) fn remove(&mut self, client: ConnectionId, number: u64) {
        if let Some(numbers) = self.0.get_mut(&client) {
            numbers.remove(&number);
            if numbers.is_empty() {
                self.0.remove(&client);
            }
        }
    }

    pub(super) fn count(&self, client: ConnectionId) -> usize {
        self.0.get(&client).map_or(0, BTreeSet::len)
    }

    /// The client's, newest first.
    pub(super) fn newest(&self, client: ConnectionId) -> impl Iterator<Item = u64> {
        self.0.get(&client).into_iter().flatten().rev().copied()
    }

    /// Takes all that are the client's.
    pub(super) fn take(&mut self, client: ConnectionId) -> BTreeSet<u64> {
        self.0.remove(&client).unwrap_or_default()
    }
}
