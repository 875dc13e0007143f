//! Leftovers of clients that have gone: goals and calls that they have not answered, and what they had registered.
//!
//! **Invariant:** taking them in costs the same however many they are.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use super::kept::KeptEntry;
use super::topics::Subscription;
use crate::actors::ConnectionId;

/// All leftovers, one entry for each client that has gone: goals and calls by their numbers.
#[derive(Default)]
pub(crate) struct PendingCleanup {
    goals: VecDeque<BTreeSet<u64>>,
    calls: VecDeque<BTreeSet<u64>>,
    registrations: VecDeque<(ConnectionId, Registrations)>,
}

/// All that one client had registered.
pub(crate) type Registrations = Box<dyn Iterator<Item = Registration>>;

/// One thing that a client had registered, under its name, with its entry.
pub(crate) enum Registration {
    Advertised(Box<str>, KeptEntry),
    Subscribed(Arc<str>, Vec<Subscription>),
    Provided(Box<str>, KeptEntry),
    ServedAction(Box<str>, KeptEntry),
}

impl PendingCleanup {
    pub(crate) fn add(&mut self, goals: BTreeSet<u64>, calls: BTreeSet<u64>) {
        for (left, numbers) in [(&mut self.goals, goals), (&mut self.calls, calls)] {
            if !numbers.is_empty() {
                left.push_back(numbers);
            }
        }
    }

    pub(crate) fn add_registrations(&mut self, client: ConnectionId, all: Registrations) {
        self.registrations.push_back((client, all));
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.goals.is_empty() && self.calls.is_empty() && self.registrations.is_empty()
    }

    pub(crate) fn next_goal(&mut self) -> Option<u64> {
        next(&mut self.goals, BTreeSet::pop_first)
    }

    pub(crate) fn next_call(&mut self) -> Option<u64> {
        next(&mut self.calls, BTreeSet::pop_first)
    }

    pub(crate) fn next_registration(&mut self) -> Option<(ConnectionId, Registration)> {
        next(&mut self.registrations, |(client, all)| {
            Some((*client, all.next()?))
        })
    }
}

/// Takes the next of all leftovers; `take` takes the next of one client's.
fn next<L, T>(left: &mut VecDeque<L>, take: impl Fn(&mut L) -> Option<T>) -> Option<T> {
    while let Some(first) = left.front_mut() {
        if let Some(one) = take(first) {
            return Some(one);
        }
        left.pop_front();
    }
    None
}
