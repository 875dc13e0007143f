//! The places of the clients: their number, the kept ones, and the rate of warnings that none is free. Newcomers have
//! slots instead.
//!
//! **Invariant:** no more clients get a place than there are places. Only the oldest newcomer is evicted.

use std::collections::{BTreeMap, VecDeque};
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use crate::options::DEFAULT_CLIENTS;

/// Most places that are kept for HTTP, WebSocket and the program's own commands. A small `--clients` keeps fewer.
pub const KEPT_PLACES: usize = 16;
/// Most newcomers: connections without a token yet, or without a free place. They are counted separately from the
/// clients, and the next newcomer evicts the oldest. A newcomer that sends its token at once never becomes the
/// oldest.
pub const MAX_NEWCOMERS: usize = 128;
/// Shortest time between two warnings.
const WARNING_INTERVAL: Duration = Duration::from_secs(60);

/// Why a client was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// No place is free.
    #[error(
        "too many connections: this runtime serves {clients} clients at once and keeps {kept} of these places for HTTP \
         and WebSocket; --clients sets the number"
    )]
    Full {
        /// How many clients are served.
        clients: usize,
        /// How many of their places are kept.
        kept: usize,
    },
    /// It has not sent the required token, and too many such clients wait.
    #[error("this runtime requires its token first, and too many connections wait without a token")]
    NoToken,
    /// The runtime is ending.
    #[error("shutting down")]
    Closed,
}

/// The places, and the refusals since the last warning.
#[derive(Debug)]
pub(in crate::actors) struct Places {
    /// The number of places.
    clients: usize,
    /// The number of kept places.
    kept: usize,
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
    pub(in crate::actors) fn of(clients: usize) -> Self {
        let kept = clients.div_ceil(16).min(KEPT_PLACES);
        Self {
            clients,
            kept: kept.min(clients.saturating_sub(1)),
            refused: 0,
            warned: None,
        }
    }

    /// Whether there is a place for one more client when `taken` places are in use.
    pub(in crate::actors) const fn check_free(
        &self,
        taken: usize,
        may_use_kept: bool,
    ) -> Result<(), Refused> {
        let Self { clients, kept, .. } = *self;
        let free = if may_use_kept {
            clients
        } else {
            clients - kept
        };
        if taken < free {
            Ok(())
        } else {
            Err(Refused::Full { clients, kept })
        }
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
    pub(in crate::actors) fn warn_of_refusal(
        &mut self,
        all: impl Iterator<Item = IpAddr>,
        now: Instant,
    ) {
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

// ---- newcomers ------------------------------------------------------------------------------------------------------

/// A fixed number of slots, oldest holder first. When all are in use, a newcomer evicts the oldest holder. Honest
/// clients finish quickly, so slow ones become the oldest. Refusing the newcomer would block honest clients.
#[derive(Debug)]
pub struct Slots {
    most: usize,
    /// A sender for each holder. It is dropped when the holder is evicted.
    taken: Mutex<VecDeque<oneshot::Sender<()>>>,
}

/// A slot that is in use. It ends when its holder is evicted. Dropping it frees the slot.
pub(in crate::actors) type HeldSlot = oneshot::Receiver<()>;

/// [`MAX_NEWCOMERS`] slots.
impl Default for Slots {
    fn default() -> Self {
        Self::new(MAX_NEWCOMERS)
    }
}

impl Slots {
    /// Makes `most` slots, all of them free.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            most,
            taken: Mutex::default(),
        }
    }

    /// Takes a slot. Evicts the oldest holder if none is free.
    pub(in crate::actors) fn take(&self) -> HeldSlot {
        let (sender, slot) = oneshot::channel();
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|holder| !holder.is_closed());
        if taken.len() >= self.most {
            taken.pop_front();
        }
        taken.push_back(sender);
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sixteenth_of_the_places_is_kept_and_never_the_last_one() {
        for (clients, kept) in [(1, 0), (2, 1), (8, 1), (17, 2), (256, 16), (4096, 16)] {
            let places = Places::of(clients);
            assert!(
                places.check_free(clients - kept - 1, false).is_ok(),
                "{clients}"
            );
            assert!(
                places.check_free(clients - kept, false).is_err(),
                "{clients}"
            );
            assert!(places.check_free(clients - 1, true).is_ok(), "{clients}");
            assert!(places.check_free(clients, true).is_err(), "{clients}");
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
