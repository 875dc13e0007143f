//! Goals and calls that clients have left unanswered, and what they had registered.
//!
//! **Invariant:** taking it in costs the same however much it is.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use super::topics::Subscription;
use crate::actors::ConnectionId;
use crate::actors::resources::budget::Share;

/// All that is to be ended, together as it was left: goals and calls by their numbers.
#[derive(Default)]
pub(super) struct Left {
    goals: VecDeque<BTreeSet<u64>>,
    calls: VecDeque<BTreeSet<u64>>,
    registrations: VecDeque<(ConnectionId, Registrations)>,
}

/// All that one client had registered.
pub(super) type Registrations = Box<dyn Iterator<Item = Registration>>;

/// One thing that a client had registered, under its name, with its share of the account.
pub(super) enum Registration {
    Advertised(Box<str>, Share),
    Subscribed(Arc<str>, Vec<Subscription>),
    Provided(Box<str>, Share),
    Pursued(Box<str>, Share),
}

impl Left {
    pub(super) fn add(&mut self, goals: BTreeSet<u64>, calls: BTreeSet<u64>) {
        for (left, numbers) in [(&mut self.goals, goals), (&mut self.calls, calls)] {
            if !numbers.is_empty() {
                left.push_back(numbers);
            }
        }
    }

    pub(super) fn add_registrations(&mut self, client: ConnectionId, all: Registrations) {
        self.registrations.push_back((client, all));
    }

    pub(super) fn is_empty(&self) -> bool {
        self.goals.is_empty() && self.calls.is_empty() && self.registrations.is_empty()
    }

    pub(super) fn next_goal(&mut self) -> Option<u64> {
        next(&mut self.goals, BTreeSet::pop_first)
    }

    pub(super) fn next_call(&mut self) -> Option<u64> {
        next(&mut self.calls, BTreeSet::pop_first)
    }

    pub(super) fn next_registration(&mut self) -> Option<(ConnectionId, Registration)> {
        next(&mut self.registrations, |(client, all)| {
            Some((*client, all.next()?))
        })
    }
}

/// The next of all that was left, by what takes the next of what one client has left.
fn next<L, T>(left: &mut VecDeque<L>, take: impl Fn(&mut L) -> Option<T>) -> Option<T> {
    while let Some(first) = left.front_mut() {
        if let Some(one) = take(first) {
            return Some(one);
        }
        left.pop_front();
    }
    None
}
