//! Keeps a thread awake for a moment after a call, because the next message is likely to arrive at once.
//!
//! A call passes from the gateway's thread to the arm's and back. Waking a thread on a sleeping core takes longer
//! than all the work of the call, and happens twice per call. Other threads are not delayed, because the thread
//! yields its core at every turn. `docs/benchmarks.md` has both costs.
//!
//! **Invariant:** a thread stays awake for at most [`MOMENT`] after the last call, and not at all in an idle
//! runtime.

use std::cell::Cell;
use std::time::{Duration, Instant};

use crate::actors::resources::work_clock;

/// Longer than the time between two calls of a client on the same machine, and short compared with a tick.
pub const MOMENT: Duration = Duration::from_micros(50);

thread_local! {
    /// The time until which this thread stays awake; `None` while it may sleep.
    static UNTIL: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Keeps the present thread awake for another [`MOMENT`].
pub fn stay_awake() {
    // A simulation has one thread, and its time does not pass while this thread is awake.
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
