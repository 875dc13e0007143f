//! Calls and goals that were forwarded to their providers and have not ended.
//!
//! **Invariant:** each ends once: by its provider's answer, by its deadline, or when its caller or its provider
//! disconnects.

use std::collections::{BTreeMap, BTreeSet};

use tokio::time::Instant;

use super::registrations::Entry;
use crate::actors::ConnectionId;
use crate::actors::node::Working;
use crate::protocol::names::{self, own_id, own_id_number};
use crate::protocol::op::Served;
use crate::protocol::wire::json::Payload;

/// A call or a goal.
pub struct Forwarded {
    /// The client that sent it.
    pub caller: ConnectionId,
    /// The caller's id of the request.
    pub id: Option<Payload>,
    /// The client that serves it.
    pub provider: ConnectionId,
    /// The name of the service or action, as the caller spells it.
    pub name: Box<str>,
    /// Whether it is a call or a goal.
    pub kind: Served,
    /// A call ends at its deadline. The registry may notice that later if the process was suspended. A goal has none.
    pub deadline: Option<Instant>,
    /// The server's spelling of a goal's action. The goal can be cancelled under it.
    pub spelling: Option<Box<str>>,
    /// Whether the sender of a goal gets feedback.
    pub wants_feedback: bool,
    /// Whether a goal was cancelled with all others of its action. Its server is notified once.
    pub is_cancelled: bool,
    /// A caller that has stopped sending is removed when its last call has ended.
    pub _working: Option<Working>,
    /// Its part of the caller's limit [`MAX_REGISTERED`](super::registrations::MAX_REGISTERED).
    pub _entry: Entry,
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
pub struct ForwardedRequests {
    outstanding: BTreeMap<u64, Forwarded>,
    /// The numbers under each key.
    index: BTreeSet<(RequestKey, u64)>,
    made: u64,
}

impl ForwardedRequests {
    /// Adds a request. Returns its id at its provider.
    pub fn add(&mut self, request: Forwarded) -> String {
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
    pub fn find_answered(
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
        let is_meant = id.is_some() || name.is_none_or(|name| names::are_same(&request.name, name));
        let is_theirs = request.provider == provider && request.kind == kind;
        (is_theirs && is_meant).then_some(number)
    }

    /// Removes and returns the request that [`find_answered`](Self::find_answered) finds.
    pub fn take_answered(
        &mut self,
        kind: Served,
        id: Option<&Payload>,
        name: Option<&str>,
        provider: ConnectionId,
    ) -> Option<Forwarded> {
        let number = self.find_answered(kind, id, name, provider)?;
        self.take(number)
    }

    /// The newest goal of `caller` with this `id`, and its id at the provider.
    pub fn newest_goal(
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
    pub fn cancel_all(
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

    /// The request with this number.
    pub fn get(&self, number: u64) -> Option<&Forwarded> {
        self.outstanding.get(&number)
    }

    /// Removes and returns a request.
    pub fn take(&mut self, number: u64) -> Option<Forwarded> {
        let request = self.outstanding.remove(&number)?;
        for key in request.keys() {
            self.index.remove(&(key, number));
        }
        Some(request)
    }

    /// Removes and returns every request, oldest first.
    pub fn take_all(&mut self) -> Vec<Forwarded> {
        let numbers: Vec<u64> = self.outstanding.keys().copied().collect();
        let requests = numbers.into_iter().map(|number| self.take(number));
        requests.flatten().collect()
    }

    /// The earliest deadline.
    pub fn next_deadline(&self) -> Option<Instant> {
        match self.index.first()? {
            (RequestKey::Deadline(deadline), _) => Some(*deadline),
            _ => None,
        }
    }

    /// Removes and returns the request with the earliest deadline, if that has passed.
    pub fn take_due(&mut self, now: Instant) -> Option<Forwarded> {
        self.next_deadline().filter(|due| *due <= now)?;
        let (_, number) = *self.index.first()?;
        self.take(number)
    }

    /// The oldest request that waits for `provider`.
    pub fn waiting_for(&self, provider: ConnectionId) -> Option<u64> {
        let of = |kind| RequestKey::Provider(provider, kind);
        let mut waiting = self.numbers_between(of(Served::Service), of(Served::Action));
        waiting.next()
    }

    /// Removes the requests of `caller`.
    pub fn forget_caller(&mut self, caller: ConnectionId) {
        let of = |kind| RequestKey::Caller(caller, kind);
        let made = self.numbers_between(of(Served::Service), of(Served::Action));
        for number in made.collect::<Vec<u64>>() {
            self.take(number);
        }
    }
}
