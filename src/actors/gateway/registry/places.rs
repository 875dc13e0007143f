//! The places of the clients: their number, the kept ones, and the rate of warnings that none is free.
//!
//! **Invariant:** a client with a place keeps it until it disconnects.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::Duration;

use tokio::time::Instant;

use crate::actors::gateway::limits::KEPT_PLACES;
use crate::options::DEFAULT_CLIENTS;

/// Shortest time between two warnings.
const WARNING_INTERVAL: Duration = Duration::from_secs(60);

/// The places, and the refusals since the last warning.
#[derive(Debug)]
pub(super) struct Places {
    /// The number of places.
    pub(super) clients: usize,
    /// The number of kept places.
    pub(super) kept: usize,
    refused: u64,
    warned: Option<Instant>,
}

impl Default for Places {
    fn default() -> Self {
        Self::of(DEFAULT_CLIENTS)
    }
}

impl Places {
    /// Places for `clients` clients. At least one of them is not kept.
    pub(super) fn of(clients: usize) -> Self {
        let kept = clients.div_ceil(16).min(KEPT_PLACES);
        Self {
            clients,
            kept: kept.min(clients.saturating_sub(1)),
            refused: 0,
            warned: None,
        }
    }

    /// Whether there is a place for one more client when `taken` places are in use.
    pub(super) const fn has_room(&self, taken: usize, may_use_kept: bool) -> bool {
        let kept = if may_use_kept { 0 } else { self.kept };
        taken + kept < self.clients
    }

    /// Counts a refusal. Returns the number of refusals since the last warning, if the next warning is due.
    fn count_refusal(&mut self, now: Instant) -> Option<u64> {
        self.refused += 1;
        if self
            .warned
            .is_some_and(|warned| now < warned + WARNING_INTERVAL)
        {
            return None;
        }
        self.warned = Some(now);
        Some(std::mem::take(&mut self.refused))
    }

    /// Counts a refusal and, if the next warning is due, logs it with the address that most of the clients have.
    pub(super) fn warn_of_refusal(&mut self, all: impl Iterator<Item = IpAddr>, now: Instant) {
        let Some(refused) = self.count_refusal(now) else {
            return;
        };
        let mut held: BTreeMap<IpAddr, usize> = BTreeMap::new();
        for from in all {
            *held.entry(from).or_default() += 1;
        }
        let taken: usize = held.values().sum();
        if let Some((most_from, held)) = held.into_iter().max_by_key(|(_, held)| *held) {
            tracing::warn!(
                places = self.clients,
                taken,
                refused,
                %most_from,
                held,
                "no place is free, so clients are refused; --clients sets the number of places"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sixteenth_of_the_places_is_kept_and_never_the_last_one() {
        for (clients, kept) in [(1, 0), (2, 1), (8, 1), (17, 2), (256, 16), (4096, 16)] {
            let places = Places::of(clients);
            assert!(places.has_room(clients - kept - 1, false), "{clients}");
            assert!(!places.has_room(clients - kept, false), "{clients}");
            assert!(places.has_room(clients - 1, true), "{clients}");
            assert!(!places.has_room(clients, true), "{clients}");
        }
    }

    #[test]
    fn a_warning_is_due_once_a_minute_and_counts_the_refusals_since_the_last() {
        let mut places = Places::of(1);
        let now = Instant::now();
        assert_eq!(places.count_refusal(now), Some(1));
        for _ in 0..9 {
            assert_eq!(places.count_refusal(now + WARNING_INTERVAL / 2), None);
        }
        assert_eq!(places.count_refusal(now + WARNING_INTERVAL), Some(10));
        assert_eq!(places.count_refusal(now + WARNING_INTERVAL), None);
    }
}
