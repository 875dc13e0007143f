//! The clock for the cost of work: the slices of computations and the arm's wake-ups.
//!
//! It is the machine's clock, or a counter in a simulation. There each reading costs the same, so the work between
//! two readings, and everything that follows from it, is the same in every run.
//!
//! **Invariant:** this clock is only for the cost of work. Simulation time and clients' waiting times use the
//! runtime's clock.

use std::cell::Cell;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

thread_local! {
    /// The cost of a reading on this thread, and of all readings so far; `None` for the machine's clock.
    static COUNTED: Cell<Option<(Duration, Duration)>> = const { Cell::new(None) };
}

/// The present time. Only differences on one thread count.
#[must_use]
pub fn now() -> Duration {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    let Some((cost, spent)) = COUNTED.get() else {
        return BEGAN.elapsed();
    };
    COUNTED.set(Some((cost, spent + cost)));
    spent + cost
}

/// From now on the time on this thread advances by `cost` with each reading, and not otherwise.
pub fn count(cost: Duration) {
    COUNTED.set(Some((cost, Duration::ZERO)));
}

/// Whether readings are counted on this thread.
#[must_use]
pub fn is_counted() -> bool {
    COUNTED.get().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_look_costs_the_same_where_looks_are_counted() {
        assert!(!is_counted());
        count(Duration::from_micros(100));
        let began = now();
        for looks in 1..=50 {
            assert_eq!(now() - began, looks * Duration::from_micros(100));
        }
        let elsewhere = std::thread::spawn(is_counted).join();
        assert!(
            !elsewhere.unwrap(),
            "another thread has the machine's clock"
        );
    }
}
