//! A run that is repeated, because a browser's clock is too coarse for one run.
//!
//! **Invariant:** the samples and the errors are those of the first run; only its time is an average.

use std::time::Duration;

use pendularm::services::study::{Present, Ran, RolloutWork, RunAnswer, RunOffline, Work};

/// The least measured time. A browser's clock has steps of 0.1 ms or 1 ms.
const LEAST_MEASURED: Duration = Duration::from_millis(20);
/// The most evaluations of the dynamics in one measurement, in case the clock does not advance.
const MOST_EVALUATIONS: u64 = 4_000_000;

/// A run that is repeated until `LEAST_MEASURED` has passed. Its time is the mean of all runs.
pub(super) struct Repeated<const N: usize> {
    /// The same run without samples and reference, whose time is not measured.
    alone: RunOffline<N>,
    present: Present<N>,
    work: RolloutWork<N>,
    first: Option<Box<Ran<N>>>,
    took: Duration,
    runs: u32,
}

impl<const N: usize> Repeated<N> {
    pub(super) fn new(ask: RunOffline<N>, present: Present<N>) -> Self {
        Self {
            work: RolloutWork::new(&ask, present),
            alone: RunOffline {
                samples: Some(2),
                reference: None,
                ..ask
            },
            present,
            first: None,
            took: Duration::ZERO,
            runs: 0,
        }
    }
}

impl<const N: usize> Work<RunAnswer<N>> for Repeated<N> {
    fn most_bytes(&self) -> usize {
        self.work.most_bytes().saturating_mul(2)
    }

    fn advance(&mut self, clock: fn() -> Duration) -> Option<RunAnswer<N>> {
        let ran = match self.work.advance(clock)? {
            Ok(ran) => ran,
            Err(why) => return Some(Err(why)),
        };
        self.took += ran.took;
        self.runs += 1;
        let mut first = self.first.take().unwrap_or(ran);
        let evaluations = u64::from(self.runs).saturating_mul(first.run.evaluations);
        if self.took >= LEAST_MEASURED || evaluations >= MOST_EVALUATIONS {
            first.took = self.took / self.runs;
            return Some(Ok(first));
        }
        self.first = Some(first);
        self.work = RolloutWork::new(&self.alone, self.present);
        None
    }
}
