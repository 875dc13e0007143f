//! Wrong tokens, slowed down: an address is answered so many times a second and no more.
//!
//! Only wrong tokens wait. The right one is let in at once, from wherever it comes: whoever guesses on the holder's own
//! machine must not lock the holder out. So this keeps a loop of guesses from being fast, and what keeps guessing
//! hopeless is the [length](crate::protocol::op::token::MIN_TOKEN) of a token: an answer that does not come tells
//! something too.
//!
//! **Invariant:** what is kept is bounded, whoever guesses from wherever.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::actors::gateway::limits::HEAD_TIME;

/// Time between two answers to wrong tokens of one address.
pub const GUESS_INTERVAL: Duration = Duration::from_millis(100);
/// Wrong tokens that are answered at once after a while without any: people mistype, and a page that was open before
/// the token changed asks with the old one.
pub const FREE_GUESSES: u32 = 5;
/// Addresses that are kept in mind, some 64 KiB of them. Who has more of them is not slowed down by this.
pub const MAX_ADDRESSES: usize = 1024;

/// Who has guessed wrongly of late: for each address the time by which it is owed no delay any more.
#[derive(Debug, Default)]
pub(super) struct Guesses(Mutex<HashMap<IpAddr, Instant>>);

impl Guesses {
    /// How long the answer to a wrong token waits that came from there now; `None` if there are so many that it is
    /// not answered.
    pub(super) fn wait(&self, from: IpAddr) -> Option<Duration> {
        let (now, from) = (Instant::now(), household(from));
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MAX_ADDRESSES && !known.contains_key(&from) {
            let calmest = known.iter().min_by_key(|(_, even)| **even);
            if let Some(calmest) = calmest.map(|(address, _)| *address) {
                known.remove(&calmest);
            }
        }
        let even = known.entry(from).or_insert(now);
        let ahead = even.saturating_duration_since(now);
        let wait = ahead.saturating_sub(GUESS_INTERVAL * (FREE_GUESSES - 1));
        if wait >= HEAD_TIME {
            return None;
        }
        *even = now + ahead + GUESS_INTERVAL;
        Some(wait)
    }
}

/// The address, or of IPv6 the network that one household has at least.
fn household(address: IpAddr) -> IpAddr {
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
        let guesses = Guesses::default();
        for _ in 0..FREE_GUESSES {
            assert_eq!(guesses.wait(HERE), Some(Duration::ZERO));
        }
        for number in 1..50 {
            assert_eq!(guesses.wait(HERE), Some(number * GUESS_INTERVAL));
        }
        assert_eq!(guesses.wait(HERE), None, "too far ahead");
        let elsewhere = "192.0.2.1".parse().unwrap();
        assert_eq!(guesses.wait(elsewhere), Some(Duration::ZERO));
        tokio::time::advance(Duration::from_secs(1)).await;
        assert_eq!(guesses.wait(HERE), Some(40 * GUESS_INTERVAL));
        tokio::time::advance(Duration::from_secs(60)).await;
        assert_eq!(guesses.wait(HERE), Some(Duration::ZERO), "forgiven");
    }

    #[tokio::test(start_paused = true)]
    async fn so_many_addresses_are_kept_and_the_calmest_goes_first() {
        let guesses = Guesses::default();
        for _ in 0..=FREE_GUESSES {
            guesses.wait(HERE);
        }
        for number in 0..2 * MAX_ADDRESSES {
            let bits = u32::try_from(number).unwrap();
            assert!(guesses.wait(IpAddr::V4(bits.into())).is_some());
            assert!(guesses.0.lock().unwrap().len() <= MAX_ADDRESSES);
        }
        assert_eq!(
            guesses.wait(HERE),
            Some(2 * GUESS_INTERVAL),
            "not forgotten"
        );
    }

    #[test]
    fn an_address_is_a_household() {
        let same = |one: &str, other: &str| {
            household(one.parse().unwrap()) == household(other.parse().unwrap())
        };
        assert!(same("2001:db8::1", "2001:db8::2:3"));
        assert!(same("::ffff:192.0.2.1", "192.0.2.1"));
        assert!(!same("2001:db8::1", "2001:db8:0:1::1"));
        assert!(!same("192.0.2.1", "192.0.2.2"));
    }
}
