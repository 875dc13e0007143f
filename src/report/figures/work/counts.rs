//! Kinds of steps with their times, and the counts that the script has left.
//!
//! **Invariant:** a count that is not there is none, not zero.

use std::collections::HashMap;

use crate::math::count::in_f64;
use crate::report::making::Making;
use crate::report::timing::Timing;

/// Steps of a run.
pub(super) const STEPS: u64 = 20_000;

/// One kind of step, by the name that `benches/src/bin/work.rs` knows it by.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) timing: Timing,
}

impl Kind {
    /// Time of one step \[s\].
    pub(super) fn step_time(&self) -> f64 {
        self.timing.minimum / in_f64(STEPS)
    }
}

/// Counts by name, as the script left them.
pub(super) type Counts = HashMap<String, f64>;

/// The counts that lie beside the page; none where nothing was counted.
pub(super) fn read(making: &Making<'_>) -> Counts {
    let text = std::fs::read_to_string(making.out.join("work.csv")).unwrap_or_default();
    text.lines()
        .skip(1)
        .filter_map(|line| {
            let mut fields = line.split(',');
            let name = fields.next()?.to_owned();
            Some((name, fields.next()?.parse().ok()?))
        })
        .collect()
}
