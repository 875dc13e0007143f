//! Numbers of what is on its way, by the client whom it concerns, and of what nobody will answer.
//!
//! **Invariant:** who goes costs no search through what concerns the others.

use std::collections::{BTreeSet, HashMap, VecDeque};

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

/// Numbers of the goals and calls that those who have gone have left unanswered, together as they were left.
#[derive(Default)]
pub(super) struct Left {
    goals: VecDeque<BTreeSet<u64>>,
    calls: VecDeque<BTreeSet<u64>>,
}

impl Left {
    pub(super) fn add(&mut self, goals: BTreeSet<u64>, calls: BTreeSet<u64>) {
        for (left, numbers) in [(&mut self.goals, goals), (&mut self.calls, calls)] {
            if !numbers.is_empty() {
                left.push_back(numbers);
            }
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.goals.is_empty() && self.calls.is_empty()
    }

    pub(super) fn next_goal(&mut self) -> Option<u64> {
        next(&mut self.goals)
    }

    pub(super) fn next_call(&mut self) -> Option<u64> {
        next(&mut self.calls)
    }
}

fn next(left: &mut VecDeque<BTreeSet<u64>>) -> Option<u64> {
    while let Some(numbers) = left.front_mut() {
        if let Some(number) = numbers.pop_first() {
            return Some(number);
        }
        left.pop_front();
    }
    None
}
