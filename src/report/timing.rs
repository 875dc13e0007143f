//! The only clock of the study: the processor time of a computation, as the minimum of repeats.
//!
//! The clock stands still while another program has the processor. Other work of the machine can still only make a run
//! longer, so the minimum is the best estimate of the computation itself.
//! Source: Chen and Revels, *Robust benchmarking in noisy environments* (2016), arXiv:1608.04295.
//!
//! **Invariant:** one untimed run comes first. Nothing is compared, counted or written while the clock runs.

use std::hint::black_box;
use std::time::Duration;

use crate::math::count::whole;

/// The least and the largest number of repeats.
const LEAST: u32 = 3;
const MOST: u32 = 25;

/// The shortest time of `work` \[s\], repeated for about `seconds` in all.
pub(crate) fn time<T>(seconds: f64, mut work: impl FnMut() -> T) -> f64 {
    let started = now();
    black_box(work());
    // Short computations are repeated within one measurement, or the clock itself would be measured.
    const SHORTEST: f64 = 50e-6;
    let once = (now() - started).max(1e-9);
    let batch = (SHORTEST / once).ceil().clamp(1.0, 1000.0);
    let (mut repeats, mut shortest) = (0, f64::INFINITY);
    let started = now();
    while repeats < MOST && (repeats < LEAST || now() - started < seconds) {
        let start = now();
        for _ in 0..whole(batch) {
            black_box(work());
        }
        shortest = shortest.min((now() - start) / batch);
        repeats += 1;
    }
    shortest
}

/// Processor time of this thread \[s\]; elsewhere than on Unix, the time that has passed.
fn now() -> f64 {
    #[cfg(unix)]
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime).try_into();
    #[cfg(not(unix))]
    let time = Ok::<_, ()>({
        static START: std::sync::LazyLock<std::time::Instant> =
            std::sync::LazyLock::new(std::time::Instant::now);
        START.elapsed()
    });
    time.unwrap_or(Duration::ZERO).as_secs_f64()
}
