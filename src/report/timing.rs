//! The only clock of the study: the time of a computation, as the minimum of repeats with their quartiles.
//!
//! Other work of the machine can only make a run longer, so the minimum is the best estimate of the computation itself.
//! The quartiles show how noisy the machine was. Source: Chen and Revels, *Robust benchmarking in noisy environments*
//! (2016), arXiv:1608.04295.
//!
//! **Invariant:** one untimed run comes first. Nothing is compared, counted or written while the clock runs.

use std::hint::black_box;
use std::time::Instant;

use crate::math::count::whole;

/// The least and the largest number of repeats.
const LEAST: usize = 3;
const MOST: usize = 25;

/// Repeats of one computation \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Timing {
    pub(crate) minimum: f64,
    /// First and third quartile.
    pub(crate) quartiles: (f64, f64),
}

/// Times repeats of `work`, of about `seconds` in all.
pub(crate) fn time<T>(seconds: f64, mut work: impl FnMut() -> T) -> Timing {
    let started = Instant::now();
    black_box(work());
    // Short computations are repeated within one measurement, or the clock itself would be measured.
    const SHORTEST: f64 = 20e-6;
    let once = started.elapsed().as_secs_f64().max(1e-9);
    let batch = (SHORTEST / once).ceil().clamp(1.0, 1000.0);
    let mut times = Vec::with_capacity(MOST);
    let started = Instant::now();
    while times.len() < MOST && (times.len() < LEAST || started.elapsed().as_secs_f64() < seconds) {
        let start = Instant::now();
        for _ in 0..whole(batch) {
            black_box(work());
        }
        times.push(start.elapsed().as_secs_f64() / batch);
    }
    times.sort_by(f64::total_cmp);
    let at = |quarter: usize| {
        let index = (times.len().saturating_sub(1) * quarter + 2) / 4;
        times.get(index).copied().unwrap_or(f64::NAN)
    };
    Timing {
        minimum: at(0),
        quartiles: (at(1), at(3)),
    }
}
