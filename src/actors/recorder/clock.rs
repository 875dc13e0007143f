//! The time of day, for records only. No decision depends on it.
//!
//! **Invariant:** it is read once and continued with a monotonic clock, so it never runs backwards.

use std::time::{Duration, Instant, SystemTime};

/// A clock of the time of day that never runs backwards.
#[derive(Clone, Copy)]
pub(super) struct TapeClock {
    began: Instant,
    since_1970: Duration,
}

impl TapeClock {
    /// A clock that starts at the present time of day.
    pub(super) fn start() -> Self {
        let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        Self {
            began: Instant::now(),
            since_1970,
        }
    }

    /// Nanoseconds since 1970.
    pub(super) fn now(&self) -> u64 {
        let now = self.since_1970 + self.began.elapsed();
        u64::try_from(now.as_nanos()).unwrap_or(u64::MAX)
    }
}
