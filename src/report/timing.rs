//! The only clock of the study: the time of a computation, as the minimum of repeats.
//!
//! Other work of the machine can only make a run longer, so the minimum is the best estimate of the computation itself.
//! Source: Chen and Revels, *Robust benchmarking in noisy environments* (2016), arXiv:1608.04295.
//!
//! **Invariant:** one untimed run comes first. Nothing is compared, counted or written while the clock runs.

use std::hint::black_box;
use std::time::Instant;

use crate::math::count::whole;

/// The least and the largest number of repeats.
const LEAST: u32 = 3;
const MOST: u32 = 25;

/// The shortest time of `work` \[s\], repeated for about `seconds` in all.
pub(crate) fn time<T>(seconds: f64, mut work: impl FnMut() -> T) -> f64 {
    let started = Instant::now();
    black_box(work());
    // Short computations are repeated within one measurement, or the clock itself would be measured.
    const SHORTEST: f64 = 20e-6;
    let once = started.elapsed().as_secs_f64().max(1e-9);
    let batch = (SHORTEST / once).ceil().clamp(1.0, 1000.0);
    let (mut repeats, mut shortest) = (0, f64::INFINITY);
    let started = Instant::now();
    while repeats < MOST && (repeats < LEAST || started.elapsed().as_secs_f64() < seconds) {
        let start = Instant::now();
        for _ in 0..whole(batch) {
            black_box(work());
        }
        shortest = shortest.min(start.elapsed().as_secs_f64() / batch);
        repeats += 1;
    }
    shortest
}
