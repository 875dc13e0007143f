//! The time of day, as it stands in a record: the only place that asks for it, and nothing is decided by it.
//!
//! **Invariant:** it is asked for once, and counted on from there, so that it never runs backwards.

use std::time::{Duration, Instant, SystemTime};

/// A clock that tells the time of day and never runs backwards.
#[derive(Clone, Copy)]
pub(super) struct TapeClock {
    began: Instant,
    since_1970: Duration,
}

impl TapeClock {
    /// The clock as it stands now.
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
