//! Numbers of what is on its way, by the client whom it concerns.
//!
//! **Invariant:** removing a client costs time in its own entries only.

use std::collections::{BTreeSet, HashMap};

use crate::actors::ConnectionId;

/// Numbers of calls, or of goals, by client.
#[derive(Default)]
pub(crate) struct NumbersByClient(HashMap<ConnectionId, BTreeSet<u64>>);

impl NumbersByClient {
    pub(crate) fn add(&mut self, client: ConnectionId, number: u64) {
        self.0.entry(client).or_default().insert(number);
    }

    pub(crate) fn remove(&mut self, client: ConnectionId, number: u64) {
        if let Some(numbers) = self.0.get_mut(&client) {
            numbers.remove(&number);
            if numbers.is_empty() {
                self.0.remove(&client);
            }
        }
    }

    pub(crate) fn count(&self, client: ConnectionId) -> usize {
        self.0.get(&client).map_or(0, BTreeSet::len)
    }

    /// The client's numbers, newest first.
    pub(crate) fn newest(&self, client: ConnectionId) -> impl Iterator<Item = u64> {
        self.0.get(&client).into_iter().flatten().rev().copied()
    }

    /// The client's number, if it has one and no more.
    pub(crate) fn only(&self, client: ConnectionId) -> Option<u64> {
        let numbers = self.0.get(&client).filter(|numbers| numbers.len() == 1)?;
        numbers.first().copied()
    }

    /// Takes all numbers of the client.
    pub(crate) fn take(&mut self, client: ConnectionId) -> BTreeSet<u64> {
        self.0.remove(&client).unwrap_or_default()
    }
}
