//! Calls and goals that were forwarded to their providers and have not ended.
//!
//! **Invariant:** each ends once: by its provider's answer, by its deadline, or when its caller or its provider
//! disconnects.

use std::collections::{BTreeMap, BTreeSet};

use tokio::time::Instant;

use super::registrations::Entry;
use crate::actors::ConnectionId;
use crate::actors::node::Done;
use crate::protocol::names::{self, own_id, own_id_number};
use crate::protocol::op::Served;
use crate::protocol::wire::json::Payload;

/// A call or a goal.
pub(super) struct Forwarded {
    pub(super) caller: ConnectionId,
    /// The caller's id of the request.
    pub(super) id: Option<Payload>,
    pub(super) provider: ConnectionId,
    /// The name of the service or action, as the caller spells it.
    pub(super) name: Box<str>,
    pub(super) kind: Served,
    /// A call ends at its deadline. The registry may notice that later if the process was suspended. A goal has none.
    pub(super) deadline: Option<Instant>,
    /// The server's spelling of a goal's action. The goal can be cancelled under it.
    pub(super) spelling: Option<Box<str>>,
    /// Whether the sender of a goal gets feedback.
    pub(super) wants_feedback: bool,
    /// Whether a goal was cancelled with all others of its action. Its server is notified once.
    pub(super) is_cancelled: bool,
    /// A caller that has stopped sending is removed when its last call has ended.
    pub(super) _done: Option<Done>,
    /// Its part of the caller's limit [`MAX_REGISTERED`](crate::actors::gateway::limits::MAX_REGISTERED).
    pub(super) _entry: Entry,
}

/// A key of the index. Deadlines sort first, so the first entry is the next deadline.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum RequestKey {
    Deadline(Instant),
    Caller(ConnectionId, Served),
    Provider(ConnectionId, Served),
}

impl Forwarded {
    fn keys(&self) -> impl Iterator<Item = RequestKey> + use<> {
        let clients = [
            RequestKey::Caller(self.caller, self.kind),
            RequestKey::Provider(self.provider, self.kind),
        ];
        let deadline = self.deadline.map(RequestKey::Deadline);
        clients.into_iter().chain(deadline)
    }
}

/// The requests, by their numbers.
#[derive(Default)]
pub(super) struct Requests {
    outstanding: BTreeMap<u64, Forwarded>,
    /// The numbers under each key.
    index: BTreeSet<(RequestKey, u64)>,
    made: u64,
}

impl Requests {
    /// Adds a request. Returns its id at its provider.
    pub(super) fn add(&mut self, request: Forwarded) -> String {
        self.made += 1;
        let number = self.made;
        self.index.extend(request.keys().map(|key| (key, number)));
        self.outstanding.insert(number, request);
        own_id(number)
    }

    /// The numbers of the requests under a key, oldest first.
    fn numbers(&self, key: RequestKey) -> impl DoubleEndedIterator<Item = u64> + '_ {
        self.numbers_between(key, key)
    }

    /// The numbers of the requests under the keys from `first` to `last`, oldest first under each key.
    fn numbers_between(
        &self,
        first: RequestKey,
        last: RequestKey,
    ) -> impl DoubleEndedIterator<Item = u64> + '_ {
        let range = self.index.range((first, 0)..=(last, u64::MAX));
        range.map(|(_, number)| *number)
    }

    /// The number of the request with this `id`, if `provider` serves it. Without an id, it is the only request that
    /// waits for `provider`, if its name is `name`.
    pub(super) fn meant(
        &self,
        kind: Served,
        id: Option<&Payload>,
        name: Option<&str>,
        provider: ConnectionId,
    ) -> Option<u64> {
        let number = match id {
            Some(id) => own_id_number(id.get())?,
            None => {
                let mut numbers = self.numbers(RequestKey::Provider(provider, kind));
                numbers.next().filter(|_| numbers.next().is_none())?
            }
        };
        let request = self.outstanding.get(&number)?;
        let is_late = request
            .deadline
            .is_some_and(|deadline| Instant::now() > deadline);
        let is_meant = id.is_some() || name.is_none_or(|name| names::are_same(&request.name, name));
        let is_theirs = request.provider == provider && request.kind == kind;
        (is_theirs && is_meant && !is_late).then_some(number)
    }

    /// The newest goal of `caller` with this `id`, and its id at the provider.
    pub(super) fn goal_made_under(
        &self,
        id: Option<&Payload>,
        name: &str,
        caller: ConnectionId,
    ) -> Option<(String, &Forwarded)> {
        let key = RequestKey::Caller(caller, Served::Action);
        let numbers = self.numbers(key).rev();
        let mut requests = numbers.filter_map(|number| Some((number, self.get(number)?)));
        let (number, request) =
            requests.find(|(_, one)| one.id.as_ref() == id && names::are_same(&one.name, name))?;
        Some((own_id(number), request))
    }

    /// Marks the goals of an action at `provider` as cancelled, oldest first and at most `limit`. Returns their ids there,
    /// and whether any remain. A goal is returned only once.
    pub(super) fn cancel_all(
        &mut self,
        action: &str,
        provider: ConnectionId,
        limit: usize,
    ) -> (Vec<String>, bool) {
        let numbers = self.numbers(RequestKey::Provider(provider, Served::Action));
        let is_left = |goal: &Forwarded| !goal.is_cancelled && names::are_same(&goal.name, action);
        let left = numbers.filter(|number| self.get(*number).is_some_and(is_left));
        let mut next: Vec<u64> = left.take(limit + 1).collect();
        let is_rest = next.len() > limit;
        next.truncate(limit);
        for number in &next {
            if let Some(goal) = self.outstanding.get_mut(number) {
                goal.is_cancelled = true;
            }
        }
        (next.into_iter().map(own_id).collect(), is_rest)
    }

    pub(super) fn get(&self, number: u64) -> Option<&Forwarded> {
        self.outstanding.get(&number)
    }

    /// Removes and returns a request.
    pub(super) fn take(&mut self, number: u64) -> Option<Forwarded> {
        let request = self.outstanding.remove(&number)?;
        for key in request.keys() {
            self.index.remove(&(key, number));
        }
        Some(request)
    }

    /// Removes and returns every request, oldest first.
    pub(super) fn take_all(&mut self) -> Vec<Forwarded> {
        let numbers: Vec<u64> = self.outstanding.keys().copied().collect();
        let requests = numbers.into_iter().map(|number| self.take(number));
        requests.flatten().collect()
    }

    /// The earliest deadline.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        match self.index.first()? {
            (RequestKey::Deadline(deadline), _) => Some(*deadline),
            _ => None,
        }
    }

    /// Removes and returns the request with the earliest deadline, if that has passed.
    pub(super) fn take_due(&mut self, now: Instant) -> Option<Forwarded> {
        self.next_deadline().filter(|due| *due <= now)?;
        let (_, number) = *self.index.first()?;
        self.take(number)
    }

    /// The oldest request that waits for `provider`.
    pub(super) fn waiting_for(&self, provider: ConnectionId) -> Option<u64> {
        let of = |kind| RequestKey::Provider(provider, kind);
        let mut waiting = self.numbers_between(of(Served::Service), of(Served::Action));
        waiting.next()
    }

    /// Removes the requests of `caller`.
    pub(super) fn forget_caller(&mut self, caller: ConnectionId) {
        let of = |kind| RequestKey::Caller(caller, kind);
        let made = self.numbers_between(of(Served::Service), of(Served::Action));
        for number in made.collect::<Vec<u64>>() {
            self.take(number);
        }
    }
}
