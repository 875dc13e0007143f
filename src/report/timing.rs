//! The only clock of the study: the processor time of a computation, as median and spread of its runs.
//!
//! The clock stands still while another program has the processor. Other work of the machine can still make a run
//! longer, so every time has the times below which 10 and 90 % of the runs lie.
//!
//! **Invariant:** one untimed run comes first. Nothing is compared, counted or written while the clock runs.

use std::hint::black_box;
use std::time::Duration;

use super::svg::seconds;
use crate::math::count::whole;

/// The runs of every measured time: the median and both ends are runs.
pub(crate) const RUNS: usize = 31;

/// A measured time \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Time {
    pub(crate) median: f64,
    /// The times below which 10 and 90 % of the runs lie.
    pub(crate) spread: (f64, f64),
}

impl std::fmt::Display for Time {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [low, median, high] = [self.spread.0, self.median, self.spread.1].map(seconds);
        write!(f, "{median} (10 to 90 %: {low} to {high})")
    }
}

/// The time of `work`.
pub(crate) fn time<T>(mut work: impl FnMut() -> T) -> Time {
    let started = now();
    black_box(work());
    // Short computations are repeated within one measurement, or the clock itself would be measured.
    const SHORTEST: f64 = 50e-6;
    let once = (now() - started).max(1e-9);
    let batch = (SHORTEST / once).ceil().clamp(1.0, 1000.0);
    let mut times = [0.0; RUNS];
    for time in &mut times {
        let start = now();
        for _ in 0..whole(batch) {
            black_box(work());
        }
        *time = (now() - start) / batch;
    }
    times.sort_by(f64::total_cmp);
    let at = |tenth: usize| times.get(tenth * (RUNS - 1) / 10);
    let at = |tenth| at(tenth).copied().unwrap_or(f64::NAN);
    Time {
        median: at(5),
        spread: (at(1), at(9)),
    }
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
