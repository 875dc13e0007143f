//! Computes how many whole steps are due, so that simulation time runs at wall time.
//!
//! The pacer gets the time and keeps two numbers: the time from which it counts (the anchor) and the steps taken
//! since. `T` seconds after the anchor, `⌊T / timestep⌋` steps must have been taken. The missing steps are due.
//!
//! ```text
//! anchor ├──step──┼──step──┼──step──┼──step──┼─── now        taken = 2, due = 2
//! ```
//!
//! A machine that falls behind catches up at most [`CATCH_UP`] and the step in progress. Steps beyond that are
//! dropped by moving the anchor, so no burst follows a long stall.
//!
//! **Invariant:** the steps due come from one division of the time since the anchor, never from a running sum. So
//! 1 ms stays exact for days. No call returns more than `⌊CATCH_UP / timestep⌋ + 1`.

use std::time::Duration;

/// Wall time that is caught up after a delay. It covers ordinary delays of a machine, and is too short for a visible
/// jump of the arm.
pub const CATCH_UP: Duration = Duration::from_millis(250);

const NANOSECONDS: f64 = 1e9;

/// Relative allowance for rounding in the division. Without it, 60 steps of 1/60 s might take a nanosecond more
/// than a second.
///
/// Three roundings can lower the quotient, by 2^-53 each: the one of the timestep itself, the one to nanoseconds, and
/// the division's. Four are allowed, which makes a step due less than a nanosecond too early in the first ten days.
const SLACK: f64 = 1.0 + 2.0 * f64::EPSILON;

/// Counts whole steps against a clock that the caller reads.
///
/// ```
/// use pendularm::math::pacer::Pacer;
/// use std::time::Duration;
///
/// let mut pacer = Pacer::new(Duration::ZERO, 0.1);
/// assert_eq!(pacer.due(Duration::from_millis(230)), 2);
/// pacer.took(1); // the other step stays due
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
    /// Counts steps of `timestep` \[s\] from `now`, a time since any fixed epoch. A timestep that is not positive is an
    /// error of the caller, but does not panic.
    #[must_use]
    pub fn new(now: Duration, timestep: f64) -> Self {
        Self {
            anchor: now,
            timestep,
            taken: 0,
        }
    }

    /// Restarts at `now`, after a new timestep, a resume or a reset. No steps are due, and the unfinished fraction of a
    /// step is discarded.
    pub fn restart(&mut self, now: Duration, timestep: f64) {
        *self = Self::new(now, timestep);
    }

    /// Steps due at `now`. They stay due until [`Pacer::took`] reports them. Steps beyond [`CATCH_UP`] and the step in
    /// progress are dropped. No step is due at a `now` before the last one.
    pub fn due(&mut self, now: Duration) -> u64 {
        let most = self.whole_steps(CATCH_UP).saturating_add(1);
        let due = self.steps_due(now);
        if due <= most {
            return due;
        }
        let step = Duration::try_from_secs_f64(self.timestep).unwrap_or_default();
        self.anchor = now.saturating_sub(CATCH_UP.saturating_add(step));
        self.taken = 0;
        self.steps_due(now).min(most)
    }

    /// Records that `steps` steps were taken, possibly fewer than were due.
    pub fn took(&mut self, steps: u64) {
        self.taken = self.taken.saturating_add(steps);
    }

    /// Wall time since the last step taken was due \[s\].
    #[must_use]
    #[allow(
        clippy::cast_precision_loss,
        reason = "a count of more than 2^53 steps is rounded"
    )]
    pub fn behind(&self, now: Duration) -> f64 {
        now.saturating_sub(self.anchor).as_secs_f64() - self.taken as f64 * self.timestep
    }

    fn steps_due(&self, now: Duration) -> u64 {
        self.whole_steps(now.saturating_sub(self.anchor))
            .saturating_sub(self.taken)
    }

    /// `⌊elapsed / timestep⌋`; `u64::MAX` if that is too large, 0 if it is NaN.
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
