//! Services that clients provide: their providers, and the calls that are on their way.
//!
//! **Invariant:** a forwarded call is completed by its own provider's connection, or by its end, and only once.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use tokio::time::Instant;

use super::kept::KeptEntry;
use super::numbers::NumbersByClient;
use crate::actors::ConnectionId;
use crate::protocol::names::{self, OWN_ID_PREFIX};
use crate::protocol::wire::payload::Payload;

/// Longest spelling of such an id in JSON: the prefix, twenty digits, quotes, every character escaped as `\u0070`.
const LONGEST_CALL_ID: usize = 6 * (OWN_ID_PREFIX.len() + 20) + 2;

/// A call that was forwarded to its provider and not answered yet.
pub(crate) struct Forwarded {
    pub(crate) caller: ConnectionId,
    pub(crate) id: Option<Payload>,
    pub(crate) provider: ConnectionId,
    /// The service's name as the caller spells it.
    pub(crate) service: Box<str>,
    /// When the caller's patience ends. The registry may look later, if the process has stood still.
    pub(crate) deadline: Instant,
    /// The part of its caller's room that it takes.
    pub(crate) _entry: KeptEntry,
}

/// The provider of a service.
#[derive(Clone)]
pub(crate) struct Provider {
    pub(crate) connection: ConnectionId,
    /// The service's name as the provider spells it: it is called by that.
    pub(crate) spelling: Box<str>,
}

/// Providers and outstanding calls.
#[derive(Default)]
pub(crate) struct Services {
    /// The providers, by absolute name of the service.
    providers: HashMap<Box<str>, Provider>,
    outstanding: BTreeMap<u64, Forwarded>,
    by_caller: NumbersByClient,
    by_provider: NumbersByClient,
    by_deadline: BTreeSet<(Instant, u64)>,
    calls_made: u64,
}

impl Services {
    /// Makes `provider` the provider; the newest registration wins.
    pub(crate) fn provide(&mut self, service: &str, provider: Provider) {
        self.providers.insert(service.into(), provider);
    }

    pub(crate) fn provider(&self, service: &str) -> Option<&Provider> {
        self.providers.get(service)
    }

    /// Withdraws the service if `connection` is its provider; true if it was.
    pub(crate) fn withdraw(&mut self, service: &str, connection: ConnectionId) -> bool {
        let provides = self
            .provider(service)
            .is_some_and(|provider| provider.connection == connection);
        if provides {
            self.providers.remove(service);
        }
        provides
    }

    /// A fresh number for a call that is about to be forwarded.
    pub(crate) fn next_call(&mut self) -> u64 {
        self.calls_made += 1;
        self.calls_made
    }

    /// The id under which call `number` goes to its provider.
    pub(crate) fn call_id(number: u64) -> String {
        format!("{OWN_ID_PREFIX}{number}")
    }

    /// The number of the call that has this id.
    pub(crate) fn number_of(id: &Payload) -> Option<u64> {
        let id = Some(id).filter(|id| id.get().len() <= LONGEST_CALL_ID)?;
        let id: String = serde_json::from_str(id.get()).ok()?;
        let number: u64 = id.strip_prefix(OWN_ID_PREFIX)?.parse().ok()?;
        // Each call has one id, though `+1` and `01` are numbers too.
        (id == Self::call_id(number)).then_some(number)
    }

    pub(crate) fn remember(&mut self, number: u64, call: Forwarded) {
        self.by_caller.add(call.caller, number);
        self.by_provider.add(call.provider, number);
        self.by_deadline.insert((call.deadline, number));
        self.outstanding.insert(number, call);
    }

    /// Calls of `connection` that wait for a provider's answer.
    pub(crate) fn waiting_for(&self, connection: ConnectionId) -> usize {
        self.by_caller.count(connection)
    }

    /// Takes the outstanding call that `provider` answers with `id`, if it is that provider's. Without an id, takes the
    /// only one that waits for `provider`, if it is of `service`.
    pub(crate) fn complete(
        &mut self,
        id: Option<&Payload>,
        service: Option<&str>,
        provider: ConnectionId,
    ) -> Option<Forwarded> {
        let number = match id {
            Some(id) => Self::number_of(id)?,
            None => self.by_provider.only(provider)?,
        };
        let call = self.outstanding.get(&number)?;
        let is_meant =
            id.is_some() || service.is_none_or(|name| names::are_same(&call.service, name));
        if Instant::now() > call.deadline || call.provider != provider || !is_meant {
            return None;
        }
        self.take(number)
    }

    /// Takes an outstanding call, whoever provides it.
    pub(crate) fn take(&mut self, number: u64) -> Option<Forwarded> {
        let call = self.outstanding.remove(&number)?;
        self.by_caller.remove(call.caller, number);
        self.by_provider.remove(call.provider, number);
        self.by_deadline.remove(&(call.deadline, number));
        Some(call)
    }

    /// Takes every outstanding call, oldest first.
    pub(crate) fn take_all(&mut self) -> Vec<Forwarded> {
        let numbers: Vec<u64> = self.outstanding.keys().copied().collect();
        let calls = numbers.into_iter().map(|number| self.take(number));
        calls.flatten().collect()
    }

    /// When the first outstanding call's time will be over.
    pub(crate) fn next_deadline(&self) -> Option<Instant> {
        self.by_deadline.first().map(|(deadline, _)| *deadline)
    }

    /// Takes the call whose time has been over for longest, if there is one.
    pub(crate) fn take_due(&mut self, now: Instant) -> Option<Forwarded> {
        let (_, number) = *self.by_deadline.first().filter(|(due, _)| *due <= now)?;
        self.take(number)
    }

    /// Takes the numbers of the calls that wait for `provider`, which will not answer them.
    pub(crate) fn take_numbers(&mut self, provider: ConnectionId) -> BTreeSet<u64> {
        self.by_provider.take(provider)
    }

    /// Forgets the calls that `caller` has made.
    pub(crate) fn forget_caller(&mut self, caller: ConnectionId) {
        for number in self.by_caller.take(caller) {
            self.take(number);
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::value::RawValue;

    use super::*;

    #[test]
    fn a_calls_id_is_known_however_its_provider_spells_it() {
        let payload = |json: String| Payload::from(RawValue::from_string(json).unwrap());
        let id = Services::call_id(u64::MAX);
        let escaped: String = id.bytes().map(|byte| format!("\\u{byte:04x}")).collect();
        for spelling in [format!("\"{id}\""), format!("\"{escaped}\"")] {
            let number = Services::number_of(&payload(spelling));
            assert_eq!(number, Some(u64::MAX));
        }
        let another = format!("\"{OWN_ID_PREFIX}01\"");
        assert_eq!(Services::number_of(&payload(another)), None);
    }
}
