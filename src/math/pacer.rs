//! How many whole steps are due now, so that simulation time runs at wall time.
//!
//! The pacer gets the time and keeps two numbers: the moment from which it counts (the anchor) and the steps taken
//! since. `T` seconds after the anchor, `⌊T / timestep⌋` steps must have been taken in all; missing steps are due.
//!
//! ```text
//! anchor ├──step──┼──step──┼──step──┼──step──┼─── now        taken = 2, due = 2
//! ```
//!
//! A machine that falls behind catches up with at most [`CATCH_UP`] and the step in progress. Steps beyond that are
//! dropped by moving the anchor, so that no burst follows a long stall. It uses plain arithmetic only.
//!
//! **Invariant:** the steps due come from one division of the time since the anchor, never from a running sum, so
//! that 1 ms stays exact for days. No call returns more than `⌊CATCH_UP / timestep⌋ + 1`.

use std::time::Duration;

/// Wall time that is caught up after a delay: long enough for any ordinary hiccup of a machine, too short for the arm
/// to be seen racing.
pub const CATCH_UP: Duration = Duration::from_millis(250);

const NANOSECONDS: f64 = 1e9;

/// Relative slack of the division, without which 60 steps of 1/60 s might take a nanosecond more than a second.
///
/// Three roundings can lower the quotient, by 2^-53 each: the one of the timestep itself, the one to nanoseconds, and
/// the division's. Four are granted; that brings a step forward by less than a nanosecond for the first ten days.
const SLACK: f64 = 1.0 + 2.0 * f64::EPSILON;

/// Counts whole steps against a clock that its caller reads.
///
/// ```
/// use pendularm::math::pacer::Pacer;
/// use std::time::Duration;
///
/// let mut pacer = Pacer::new(Duration::ZERO, 0.1);
/// assert_eq!(pacer.due(Duration::from_millis(230)), 2);
/// pacer.took(1); // the rest stays owed
/// assert_eq!(pacer.due(Duration::from_millis(300)), 2);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Pacer {
    /// The moment from which steps are counted, on the caller's clock.
    anchor: Duration,
    /// Length of a step \[s\].
    timestep: f64,
    /// Steps taken since the anchor.
    taken: u64,
}

impl Pacer {
    /// Counts steps of `timestep` \[s\] from `now`, a time since any fixed epoch. A timestep that is not positive makes
    /// no sense, but does no harm.
    #[must_use]
    pub fn new(now: Duration, timestep: f64) -> Self {
        Self {
            anchor: now,
            timestep,
            taken: 0,
        }
    }

    /// Starts over at `now`, after a new timestep, a resume or a reset: nothing is owed, and the unfinished fraction of
    /// a step is gone.
    pub fn restart(&mut self, now: Duration, timestep: f64) {
        *self = Self::new(now, timestep);
    }

    /// Steps due at `now`. They stay due until they are reported by [`Pacer::took`], except for those that are dropped
    /// because more than [`CATCH_UP`] and the step in progress was due. No step is due at a `now` before the last one.
    pub fn due(&mut self, now: Duration) -> u64 {
        let most = self.whole_steps(CATCH_UP).saturating_add(1);
        let due = self.owed(now);
        if due <= most {
            return due;
        }
        let step = Duration::try_from_secs_f64(self.timestep).unwrap_or_default();
        self.anchor = now.saturating_sub(CATCH_UP.saturating_add(step));
        self.taken = 0;
        self.owed(now).min(most)
    }

    /// Notes that `steps` steps were taken, perhaps fewer than were due.
    pub fn took(&mut self, steps: u64) {
        self.taken = self.taken.saturating_add(steps);
    }

    fn owed(&self, now: Duration) -> u64 {
        self.whole_steps(now.saturating_sub(self.anchor))
            .saturating_sub(self.taken)
    }

    /// `⌊elapsed / timestep⌋`; `u64::MAX` where that is too large to count, 0 where it is not a number.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "`as` saturates and takes NaN to 0, as wanted; 2^53 ns, where the first cast rounds, is 104 days"
    )]
    fn whole_steps(&self, elapsed: Duration) -> u64 {
        let steps = elapsed.as_nanos() as f64 / (self.timestep * NANOSECONDS);
        (steps * SLACK) as u64
    }
}
