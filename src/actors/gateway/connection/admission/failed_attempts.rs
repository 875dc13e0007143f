//! The rate of failed authentication: wrong tokens of one address are answered ten a second and no faster.
//!
//! Only wrong tokens wait. The right one is admitted at once, from any address: guessers on the holder's own machine
//! must not lock the holder out. The wait makes guessing slow, and the
//! [length](crate::protocol::op::token::MIN_TOKEN) of a token makes it hopeless.
//!
//! **Invariant:** at most [`MAX_ADDRESSES`] addresses are remembered.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::actors::gateway::limits::HEAD_TIME;

/// Time between two answers to wrong tokens of one address.
pub const ATTEMPT_INTERVAL: Duration = Duration::from_millis(100);
/// Wrong tokens that are answered at once after a while without any: people mistype, and a page that was open before
/// the token changed asks with the old one.
pub const FREE_ATTEMPTS: u32 = 5;
/// Addresses that are kept in mind, some 64 KiB of them. An attacker with more of them is not slowed down.
pub const MAX_ADDRESSES: usize = 1024;

/// Least time between two warnings about one address.
const WARNING_INTERVAL: Duration = Duration::from_secs(60);

/// Addresses with recent failed attempts. Each has the time at which all its attempts are answered, at one every
/// [`ATTEMPT_INTERVAL`]; every attempt moves it further ahead of now.
#[derive(Debug, Default)]
pub(crate) struct FailedAttempts {
    answers: Mutex<HashMap<IpAddr, Instant>>,
    /// Addresses that were warned about: when, and how many wrong tokens have come from them since.
    warnings: Mutex<HashMap<IpAddr, (Instant, u64)>>,
}

impl FailedAttempts {
    /// Counts a wrong token. If a warning about the address is due, returns how many came since the last.
    pub(crate) fn due_warning(&self, from: IpAddr) -> Option<u64> {
        let (now, from) = (Instant::now(), network(from));
        let mut known = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MAX_ADDRESSES && !known.contains_key(&from) {
            known.retain(|_, (warned, _)| now < *warned + WARNING_INTERVAL);
        }
        let is_full = known.len() >= MAX_ADDRESSES;
        match known.get_mut(&from) {
            Some((warned, wrong)) if now < *warned + WARNING_INTERVAL => {
                *wrong += 1;
                None
            }
            Some((warned, wrong)) => {
                *warned = now;
                Some(std::mem::take(wrong) + 1)
            }
            // More addresses in a minute than are kept in mind: nobody reads a line for each.
            None if is_full => None,
            None => {
                known.insert(from, (now, 0));
                Some(1)
            }
        }
    }

    /// How long the answer to a wrong token waits that came from there now; `None` if it is not answered, because
    /// too many came before.
    pub(crate) fn wait(&self, from: IpAddr) -> Option<Duration> {
        let (now, from) = (Instant::now(), network(from));
        let mut known = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MAX_ADDRESSES && !known.contains_key(&from) {
            let calmest = known.iter().min_by_key(|(_, even)| **even);
            if let Some(calmest) = calmest.map(|(address, _)| *address) {
                known.remove(&calmest);
            }
        }
        let even = known.entry(from).or_insert(now);
        let ahead = even.saturating_duration_since(now);
        let wait = ahead.saturating_sub(ATTEMPT_INTERVAL * (FREE_ATTEMPTS - 1));
        if wait >= HEAD_TIME {
            return None;
        }
        *even = now + ahead + ATTEMPT_INTERVAL;
        Some(wait)
    }
}

/// The address itself, or the /64 of an IPv6 address: every site has at least that.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => {
            let [a, b, c, d, ..] = address.segments();
            Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0).into()
        }
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    #[tokio::test(start_paused = true)]
    async fn a_few_are_answered_at_once_and_then_ten_a_second() {
        let attempts = FailedAttempts::default();
        for _ in 0..FREE_ATTEMPTS {
            assert_eq!(attempts.wait(HERE), Some(Duration::ZERO));
        }
        for number in 1..50 {
            assert_eq!(attempts.wait(HERE), Some(number * ATTEMPT_INTERVAL));
        }
        assert_eq!(attempts.wait(HERE), None, "too far ahead");
        let elsewhere = "192.0.2.1".parse().unwrap();
        assert_eq!(attempts.wait(elsewhere), Some(Duration::ZERO));
        tokio::time::advance(Duration::from_secs(1)).await;
        assert_eq!(attempts.wait(HERE), Some(40 * ATTEMPT_INTERVAL));
        tokio::time::advance(Duration::from_secs(60)).await;
        assert_eq!(attempts.wait(HERE), Some(Duration::ZERO), "forgiven");
    }

    #[tokio::test(start_paused = true)]
    async fn an_address_is_warned_of_once_a_minute_with_a_count() {
        let attempts = FailedAttempts::default();
        assert_eq!(attempts.due_warning(HERE), Some(1));
        for _ in 0..100 {
            assert_eq!(attempts.due_warning(HERE), None);
        }
        let elsewhere = "192.0.2.1".parse().unwrap();
        assert_eq!(attempts.due_warning(elsewhere), Some(1));
        tokio::time::advance(WARNING_INTERVAL).await;
        assert_eq!(attempts.due_warning(HERE), Some(101));
        for n in 0..2 * MAX_ADDRESSES {
            let bits = u32::try_from(n).unwrap();
            attempts.due_warning(IpAddr::V4(bits.into()));
        }
        assert!(attempts.warnings.lock().unwrap().len() <= MAX_ADDRESSES);
    }

    #[tokio::test(start_paused = true)]
    async fn so_many_addresses_are_kept_and_the_calmest_goes_first() {
        let attempts = FailedAttempts::default();
        for _ in 0..=FREE_ATTEMPTS {
            attempts.wait(HERE);
        }
        for number in 0..2 * MAX_ADDRESSES {
            let bits = u32::try_from(number).unwrap();
            assert!(attempts.wait(IpAddr::V4(bits.into())).is_some());
            assert!(attempts.answers.lock().unwrap().len() <= MAX_ADDRESSES);
        }
        assert_eq!(
            attempts.wait(HERE),
            Some(2 * ATTEMPT_INTERVAL),
            "not forgotten"
        );
    }

    #[test]
    fn an_address_of_ipv6_counts_by_its_prefix() {
        let same = |one: &str, other: &str| {
            network(one.parse().unwrap()) == network(other.parse().unwrap())
        };
        assert!(same("2001:db8::1", "2001:db8::2:3"));
        assert!(same("::ffff:192.0.2.1", "192.0.2.1"));
        assert!(!same("2001:db8::1", "2001:db8:0:1::1"));
        assert!(!same("192.0.2.1", "192.0.2.2"));
    }
}
