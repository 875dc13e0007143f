//! A goal over time: whether the end effector has reached it and stayed, and when feedback is due.
//!
//! Both get the simulation time and the end effector's position after every step, while a goal is active.
//!
//! **Invariant:** "reached" means that no judged step of the last `success_hold` seconds found the end effector farther
//! than `epsilon` from the target.

use glam::DVec2;
use libm::hypot;

/// Default of `epsilon` \[m\]: 1 % of the reach of the default arm of two links.
pub const EPSILON: f64 = 0.02;

/// Default of `success_hold` \[s\]: longer than the default arm takes to swing through such an epsilon.
pub const SUCCESS_HOLD: f64 = 0.5;

/// Feedback messages per second of simulation progress.
pub const FEEDBACK_RATE: f64 = 60.0;

/// Returns the largest rounding error of a difference of two times \[s\] near `time`.
///
/// A time is `base + k h`. The product and the sum each have an error of half a unit in the last place, at both ends.
/// The same amount is added because `h` is only the double nearest to, say, 1 ms. The total is less than four times
/// `2⁻⁵² time` (3e-12 s after an hour). Without this allowance, half a second would sometimes take one step more.
pub(super) fn rounding(time: f64) -> f64 {
    4.0 * f64::EPSILON * time.abs()
}

/// When a goal counts as reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Greatest distance between end effector and target that counts as reached \[m\], greater than 0.
    pub epsilon: f64,
    /// Simulation time that the end effector must stay there without interruption \[s\]; 0 accepts the first
    /// entry.
    pub success_hold: f64,
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            epsilon: EPSILON,
            success_hold: SUCCESS_HOLD,
        }
    }
}

/// How a goal ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The end effector stayed within `epsilon` for `success_hold`.
    Reached,
    /// The goal was cancelled, replaced by another goal, or ended by a reset.
    Preempted,
}

impl Outcome {
    /// The name that messages use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::Preempted => "preempted",
        }
    }
}

/// A stay within epsilon without interruption.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dwell {
    /// Time of the first check of the present stay; none while outside.
    entered: Option<f64>,
}

impl Dwell {
    /// Checks at simulation time `time` \[s\] whether the stay has lasted for `hold` \[s\]. A check outside restarts
    /// the stay, and so does a clock that runs backwards.
    pub fn stays(&mut self, time: f64, is_inside: bool, hold: f64) -> bool {
        let entered = self.entered.filter(|&entered| entered <= time);
        self.entered = is_inside.then(|| entered.unwrap_or(time));
        let lasted = self.entered.map(|entered| time - entered + rounding(time));
        lasted.is_some_and(|lasted| lasted >= hold)
    }
}

/// An active goal, judged at every physics step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    target: DVec2,
    criteria: Criteria,
    started: f64,
    /// The present stay within epsilon.
    dwell: Dwell,
}

impl Goal {
    /// A goal with the end effector at `target` \[m\], which starts at simulation time `now` \[s\].
    #[must_use]
    pub const fn new(target: DVec2, criteria: Criteria, now: f64) -> Self {
        Self {
            target,
            criteria,
            started: now,
            dwell: Dwell { entered: None },
        }
    }

    /// Checks the position of the end effector \[m\] after the step that ended at `time` \[s\]. Returns `true`
    /// once the goal is reached.
    ///
    /// Leaving epsilon, even for one step, restarts the stay. So does a clock that runs backwards, and a position
    /// that is not a number counts as outside.
    pub fn judge(&mut self, time: f64, end_effector: DVec2) -> bool {
        // NaN counts as outside.
        let is_near = self.distance(end_effector) <= self.criteria.epsilon;
        self.dwell.stays(time, is_near, self.criteria.success_hold)
    }

    /// The target position of the end effector \[m\].
    #[must_use]
    pub const fn target(&self) -> DVec2 {
        self.target
    }

    /// The condition for success.
    #[must_use]
    pub const fn criteria(&self) -> Criteria {
        self.criteria
    }

    /// The end effector's distance from the target \[m\]. Orientation does not count.
    #[must_use]
    pub fn distance(&self, end_effector: DVec2) -> f64 {
        let off = end_effector - self.target;
        // `DVec2::length` would overflow for an end effector that a diverging arm has thrown beyond 1e154 m.
        hypot(off.x, off.y)
    }

    /// Simulation time since the goal's start \[s\].
    #[must_use]
    pub fn elapsed(&self, time: f64) -> f64 {
        (time - self.started).max(0.0)
    }
}

/// The times at which something with a fixed rate of simulation time is due.
///
/// The first call returns `true` and starts the count, so even a goal that ends after one step reports once. After that
/// one call returns `true` in each period in which the clock moved. Steps longer than a period give one report each,
/// and missed periods are not made up. A clock that runs backwards restarts the count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cadence {
    /// Periods per second.
    rate: f64,
    count: Option<Feedbacks>,
}

/// Periods are counted from `origin`. The present `period` has been reported.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Feedbacks {
    origin: f64,
    latest: f64,
    period: f64,
}

impl Cadence {
    /// A cadence of `rate` reports per second of simulation time. `rate` is greater than 0.
    #[must_use]
    pub const fn new(rate: f64) -> Self {
        Self { rate, count: None }
    }

    /// Whether a report is due at simulation time `time` \[s\].
    pub fn due(&mut self, time: f64) -> bool {
        match &mut self.count {
            Some(count) if count.latest <= time => {
                count.latest = time;
                let period = ((time - count.origin + rounding(time)) * self.rate).floor();
                let due = period > count.period;
                count.period = count.period.max(period);
                due
            }
            _ => {
                self.count = Some(Feedbacks {
                    origin: time,
                    latest: time,
                    period: 0.0,
                });
                true
            }
        }
    }
}

impl Default for Cadence {
    fn default() -> Self {
        Self::new(FEEDBACK_RATE)
    }
}
