//! Services that clients provide: who provides what, and the calls that are on their way.
//!
//! **Invariant:** a forwarded call is completed by its own provider's connection, or by its end, and only once.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

use actix::prelude::*;
use tokio::task::AbortHandle;
use tokio::time::Instant;

use crate::actors::ConnectionId;
use crate::actors::resources::budget::Share;
use crate::protocol::names;
use crate::protocol::wire::payload::Payload;

/// The runtime's own ids for forwarded calls begin with this, so that a provider's log shows where they come from.
const CALL_ID_PREFIX: &str = "pendularm:";
/// Longest spelling of such an id in JSON: the prefix, twenty digits, quotes, every character escaped as `\u0070`.
const LONGEST_CALL_ID: usize = 6 * (CALL_ID_PREFIX.len() + 20) + 2;

/// A call that was forwarded to its provider and not answered yet.
pub(super) struct Forwarded {
    pub(super) caller: ConnectionId,
    pub(super) id: Option<Payload>,
    pub(super) provider: ConnectionId,
    /// The service's name as the caller spells it.
    pub(super) service: Box<str>,
    /// When the caller's patience ends. The timer may be heard of later than that, where the process has stood still.
    pub(super) deadline: Instant,
    pub(super) timer: AbortHandle,
    /// Its share of its caller's account. The timer has a share of its own.
    pub(super) _share: Share,
}

/// A forwarded call has waited as long as its caller allowed. From the registry's own timers; holds the call's number.
#[derive(Message)]
#[rtype(result = "()")]
pub(super) struct TimedOut(pub(super) u64);

/// Who provides a service.
#[derive(Clone)]
pub(super) struct Provider {
    pub(super) connection: ConnectionId,
    /// The service's name as the provider spells it: what it is called by.
    pub(super) spelling: Box<str>,
}

/// Providers and outstanding calls.
#[derive(Default)]
pub(super) struct Services {
    /// By absolute name.
    providers: HashMap<Box<str>, Provider>,
    outstanding: BTreeMap<u64, Forwarded>,
    /// Outstanding calls by caller, so that the limit costs no search.
    waiting: HashMap<ConnectionId, usize>,
    calls_made: u64,
}

impl Services {
    /// Makes `provider` the provider; the newest registration wins.
    pub(super) fn provide(&mut self, service: &str, provider: Provider) {
        self.providers.insert(service.into(), provider);
    }

    pub(super) fn provider(&self, service: &str) -> Option<&Provider> {
        self.providers.get(service)
    }

    /// Withdraws the service if `connection` is its provider; true if it was.
    pub(super) fn withdraw(&mut self, service: &str, connection: ConnectionId) -> bool {
        let provides = self
            .provider(service)
            .is_some_and(|provider| provider.connection == connection);
        if provides {
            self.providers.remove(service);
        }
        provides
    }

    /// A fresh number for a call that is about to be forwarded.
    pub(super) fn next_call(&mut self) -> u64 {
        self.calls_made += 1;
        self.calls_made
    }

    /// The id under which call `number` goes to its provider.
    pub(super) fn call_id(number: u64) -> String {
        format!("{CALL_ID_PREFIX}{number}")
    }

    /// The number of the call that has this id.
    pub(super) fn number_of(id: &Payload) -> Option<u64> {
        let id = Some(id).filter(|id| id.get().len() <= LONGEST_CALL_ID)?;
        let id: String = serde_json::from_str(id.get()).ok()?;
        let number: u64 = id.strip_prefix(CALL_ID_PREFIX)?.parse().ok()?;
        // One id a call: `+1` and `01` are numbers too.
        (id == Self::call_id(number)).then_some(number)
    }

    pub(super) fn remember(&mut self, number: u64, call: Forwarded) {
        *self.waiting.entry(call.caller).or_default() += 1;
        self.outstanding.insert(number, call);
    }

    /// Calls of `connection` that wait for a provider's answer.
    pub(super) fn waiting_for(&self, connection: ConnectionId) -> usize {
        self.waiting.get(&connection).copied().unwrap_or_default()
    }

    /// Takes the outstanding call that `provider` answers with `id`, if it is that provider's and of that service.
    pub(super) fn complete(
        &mut self,
        id: Option<&Payload>,
        service: &str,
        provider: ConnectionId,
    ) -> Option<Forwarded> {
        let number = Self::number_of(id?)?;
        let call = self.outstanding.get(&number)?;
        if Instant::now() > call.deadline {
            return None;
        }
        if call.provider != provider || names::absolute(&call.service) != names::absolute(service) {
            return None;
        }
        self.take(number)
    }

    /// Takes an outstanding call, whoever provides it, and stops its clock.
    pub(super) fn take(&mut self, number: u64) -> Option<Forwarded> {
        let call = self.outstanding.remove(&number)?;
        call.timer.abort();
        if let Entry::Occupied(mut waiting) = self.waiting.entry(call.caller) {
            *waiting.get_mut() -= 1;
            if *waiting.get() == 0 {
                waiting.remove();
            }
        }
        Some(call)
    }

    /// Takes every outstanding call, oldest first.
    pub(super) fn take_all(&mut self) -> Vec<Forwarded> {
        self.take_where(|_| true)
    }

    /// Takes the calls that wait for `provider`, oldest first.
    pub(super) fn take_provided_by(&mut self, provider: ConnectionId) -> Vec<Forwarded> {
        self.take_where(|call| call.provider == provider)
    }

    /// Forgets the calls that `caller` has made.
    pub(super) fn forget_caller(&mut self, caller: ConnectionId) {
        if self.waiting_for(caller) > 0 {
            self.take_where(|call| call.caller == caller);
        }
    }

    fn take_where(&mut self, wanted: impl Fn(&Forwarded) -> bool) -> Vec<Forwarded> {
        let numbers: Vec<u64> = self
            .outstanding
            .iter()
            .filter(|(_, call)| wanted(call))
            .map(|(number, _)| *number)
            .collect();
        numbers
            .into_iter()
            .filter_map(|number| self.take(number))
            .collect()
    }
}
