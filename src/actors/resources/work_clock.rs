//! The clocks on which the cost of work is measured: the slices of computations, the arm's wake-ups. How long work may
//! take is elapsed time. A client is charged the processor time of the thread that did its work: time that other
//! programs take is charged to nobody.
//!
//! It is the machine's own, unless a simulation counts instead. There each look costs the same, so that the work done
//! between two looks, and all that follows from it, is the same in every run.
//!
//! **Invariant:** only what work costs is read here. Simulation time and what a client waits for go by the runtime's
//! clock.

use std::cell::Cell;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

#[cfg(unix)]
use rustix::time::{ClockId, clock_gettime};

thread_local! {
    /// How looks are counted on this thread; none where the machine's clocks count.
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

/// Processor time that this thread has had. Only differences on one thread mean something.
#[must_use]
pub fn spent() -> Duration {
    match COUNTED.get() {
        Some(counted) => counted.look().spent,
        None => processor_time(),
    }
}

/// Nothing is charged on a machine whose clock would run backwards.
#[cfg(unix)]
fn processor_time() -> Duration {
    let spent = clock_gettime(ClockId::ThreadCPUTime);
    spent.try_into().unwrap_or_default()
}

/// Windows says only in sixtieths of a second, so elapsed time is charged there.
#[cfg(windows)]
fn processor_time() -> Duration {
    static BEGAN: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    BEGAN.elapsed()
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

    fn work(time: Duration) {
        let before = spent();
        while spent() - before < time {
            std::hint::spin_loop();
        }
    }

    /// Each thread waits for its own time, so it takes as long as the machine lets it. A tenth is far more than it
    /// costs to start a thread and to end it.
    #[test]
    fn who_works_is_charged_and_who_waits_for_another_is_not() {
        let (began, before) = (Instant::now(), spent());
        let other = std::thread::spawn(|| work(Duration::from_millis(20)));
        other.join().unwrap();
        let waited = spent() - before;
        assert!(waited < began.elapsed() / 10, "{waited:?}");
        work(Duration::from_millis(5));
    }

    #[test]
    fn each_look_costs_the_same_where_looks_are_counted() {
        assert!(!is_counted());
        count(Duration::from_micros(100));
        let began = now();
        for looks in 1..=50 {
            assert_eq!(now() - began, looks * Duration::from_micros(100));
        }
        let before = spent();
        assert_eq!(spent() - before, Duration::from_micros(100));
        let elsewhere = std::thread::spawn(is_counted).join();
        assert!(
            !elsewhere.unwrap(),
            "another thread has the machine's clock"
        );
    }
}
