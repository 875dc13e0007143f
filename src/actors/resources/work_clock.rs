//! The clock on which the cost of work is measured: the slices of computations, the arm's wake-ups.
//!
//! It is the machine's own, unless a simulation counts instead: there each look costs the same, so that the work done
//! between two looks, and all that follows from it, is the same in every run.
//!
//! **Invariant:** only what work costs is read here. Simulation time and what a client waits for go by the runtime's
//! clock.

use std::cell::Cell;
use std::time::{Duration, Instant};

thread_local! {
    /// The cost of a look on this thread, and the time at the last one; none where the machine's clock counts.
    static COUNTED: Cell<Option<(Duration, Instant)>> = const { Cell::new(None) };
}

/// The time now. Only differences mean something.
#[must_use]
pub fn now() -> Instant {
    let Some((cost, last)) = COUNTED.get() else {
        return Instant::now();
    };
    let now = last + cost;
    COUNTED.set(Some((cost, now)));
    now
}

/// From now on every look on this thread finds that `cost` has passed since the one before, and nothing else makes time
/// pass.
pub fn count(cost: Duration) {
    COUNTED.set(Some((cost, Instant::now())));
}

/// Whether looks are counted on this thread.
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
