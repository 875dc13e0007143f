//! The actors' system of a test. Generic code only boxes the test. Otherwise the compiler would compile the runtime's
//! loop again for each of some 250 tests.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::resources::work_clock;
use tokio::runtime::Builder;

/// Runs a test on one thread, in real time.
pub fn in_real_time(test: impl Future<Output = ()>) {
    to_the_end(&System::new(), test);
}

/// Runs a test on one thread, in virtual time: the clock does not move until every task waits, and each reading of the
/// work clock counts as 10 us of work.
pub fn in_virtual_time<T>(test: impl Future<Output = T>) -> T {
    counting_wake_ups(|_| test)
}

/// The same. The test gets the number of times that the thread went to sleep, which is the number of its wake-ups.
pub fn counting_wake_ups<T, F: Future<Output = T>>(test: impl FnOnce(Arc<AtomicU64>) -> F) -> T {
    work_clock::count(Duration::from_micros(10));
    let sleeps = Arc::default();
    to_the_end(&with_paused_clock(Arc::clone(&sleeps)), test(sleeps))
}

fn with_paused_clock(sleeps: Arc<AtomicU64>) -> SystemRunner {
    System::with_tokio_rt(move || {
        Builder::new_current_thread()
            .enable_all()
            .start_paused(true)
            .on_thread_park(move || {
                sleeps.fetch_add(1, Ordering::Relaxed);
            })
            .build()
            .expect("a runtime")
    })
}

fn to_the_end<'a, T>(system: &SystemRunner, test: impl Future<Output = T> + 'a) -> T {
    let test: Pin<Box<dyn Future<Output = T> + 'a>> = Box::pin(test);
    system.block_on(test)
}
