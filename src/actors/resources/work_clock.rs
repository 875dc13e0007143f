//! The clock on which the cost of work is measured: the slices of computations, the arm's wake-ups.
//!
//! It is the machine's own, unless a simulation counts instead. There each look costs the same, so that the work done
//! between two looks, and all that follows from it, is the same in every run.
//!
//! **Invariant:** only what work costs is read here. Simulation time and what a client waits for go by the runtime's
//! clock.

use std::cell::Cell;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

thread_local! {
    /// How looks are counted on this thread; none where the machine's clock counts.
    static COUNTED: Cell<Option<Counted>> = const { Cell::new(None) };
}

/// Time that passes with looks at it alone.
#[derive(Clone, Copy)]
struct Counted {
    began: Instant,
    /// The cost of a look.
    cost: Duration,
    /// The cost of all of them so far.
    spent: Duration,
}

impl Counted {
    /// Looks once more.
    fn look(mut self) -> Self {
        self.spent += self.cost;
        COUNTED.set(Some(self));
        self
    }
}

/// The time now. Only differences mean something.
#[must_use]
pub fn now() -> Instant {
    match COUNTED.get() {
        Some(counted) => counted.began + counted.look().spent,
        None => Instant::now(),
    }
}

/// The same time as a number. Only differences on one thread mean something.
#[must_use]
pub fn reading() -> Duration {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    match COUNTED.get() {
        Some(counted) => counted.look().spent,
        None => BEGAN.elapsed(),
    }
}

/// From now on every look on this thread finds that `cost` has passed since the one before, and nothing else makes time
/// pass.
pub fn count(cost: Duration) {
    COUNTED.set(Some(Counted {
        began: Instant::now(),
        cost,
        spent: Duration::ZERO,
    }));
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
        let before = reading();
        assert_eq!(reading() - before, Duration::from_micros(100));
        let elsewhere = std::thread::spawn(is_counted).join();
        assert!(
            !elsewhere.unwrap(),
            "another thread has the machine's clock"
        );
    }
}
