//! Keeps a thread awake for a moment after it has taken part in a call, because the next message is likely to come at
//! once.
//!
//! A call goes from the gateway's thread to the arm's and back. Waking a thread whose core has gone to sleep takes
//! longer than all the work of the call. A client that calls again and again would pay for it twice each time. Others
//! are let through: the thread offers its core at every turn. Both costs are measured in `docs/benchmarks.md`.
//!
//! **Invariant:** nobody stays awake for longer than [`MOMENT`] after the last call, and idle runtimes not at all.

use std::cell::Cell;
use std::time::{Duration, Instant};

use crate::actors::resources::work_clock;

/// Longer than the time from a call to a client's next one on the same machine, short beside a tick.
pub const MOMENT: Duration = Duration::from_micros(50);

thread_local! {
    /// The time until which this thread stays awake; none while it may sleep.
    static UNTIL: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// The present thread stays awake for another [`MOMENT`].
pub fn stay_awake() {
    // A simulation has one thread, and its time does not pass while that is awake.
    if work_clock::is_counted() {
        return;
    }
    let awake = UNTIL.replace(Some(Instant::now() + MOMENT)).is_some();
    if !awake {
        actix_rt::spawn(async {
            while UNTIL.get().is_some_and(|until| Instant::now() < until) {
                std::thread::yield_now();
                tokio::task::yield_now().await;
            }
            UNTIL.set(None);
        });
    }
}
