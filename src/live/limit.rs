//! The limits of the arm's timestep and control period at the present setpoint, and the error estimate of a step.
//!
//! The node `study` predicts the limit on its workers. It is kept here until the control loop changes. Publishing
//! ticks check it, only while a topic that shows it has subscribers. With the controller off the active loop is the
//! free arm, without gains and setpoint.
//!
//! **Invariant:** limits and errors are only published. Nothing is refused or changed because of them.

use std::time::Duration;

use super::limit_watch::{resemble, share_limit};
use super::{LiveArm, World};
use crate::math::shown::{Shown, shown_against};
use crate::math::simulation::ControlPeriod;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::ErrorEstimateMessage;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;
use crate::study::error_estimate::estimate;
use crate::study::motion::Motion;

/// Least time between two predictions for one arm with one set of gains. Each takes a millisecond of a worker, and
/// thousands of setpoints may arrive per second.
pub const LEAST_PAUSE: Duration = Duration::from_millis(100);

/// An exceeded limit.
enum Exceeded {
    /// The control period is beyond the controller's limit.
    Period,
    /// The timestep is beyond the limit of this motion.
    Motion(Motion),
    /// The timestep is beyond the method's limit.
    Timestep,
}

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// At a tick: publishes at once if a warning appears or ends.
    pub(super) fn watch_warnings(&mut self) {
        if !self.wants_limit() {
            return;
        }
        let is_known = !self.timestep_limit().is_nan();
        let exceeded = if is_known {
            self.exceeded().is_some()
        } else {
            self.limit.warned.0
        };
        let warned = (exceeded, self.is_held_up());
        if warned != self.limit.warned {
            self.limit.warned = warned;
            self.publish_diagnostics();
        }
    }

    /// Whether a goal or a setpoint waits for the controller, which is off.
    pub(super) fn is_held_up(&self) -> bool {
        let is_meant_to_move = self.goals.is_tracked() || self.goals.setpoint_waits;
        is_meant_to_move && !self.simulation.pid().is_enabled()
    }

    /// The active loop, if its limit must be predicted. `None` if the limit is known, requested already, or not
    /// shown. The caller passes the prediction to [`LiveArm::keep_limit`].
    pub fn limit_to_predict(&mut self) -> Option<ControlLoop<N>> {
        if self.limit.waiting || !self.wants_limit() {
            return None;
        }
        let (present, now) = (ControlLoop::in_force(&self.simulation), self.world.now());
        let settled = self.limit.asked.is_some_and(|(control, asked_at)| {
            let soon = now.saturating_sub(asked_at) < LEAST_PAUSE;
            share_limit(&control, &present) || (soon && resemble(&control, &present))
        });
        if settled {
            return None;
        }
        self.limit.asked = Some((present, now));
        self.limit.waiting = true;
        Some(present)
    }

    /// The prediction for a loop, if there is one.
    pub fn keep_limit(&mut self, of: ControlLoop<N>, limits: Option<ClockLimits>) {
        self.limit.waiting = false;
        if let Some(limits) = limits {
            self.limit.known = Some((of, limits));
        }
    }

    fn wants_limit(&self) -> bool {
        self.counts.wants(Topic::Diagnostics) || self.counts.wants(Topic::ErrorEstimate)
    }

    /// The latest predictions \[s\], of the timestep and of the control period: infinite if nothing limits, NaN
    /// while there are none. Limits for an earlier setpoint are used until the next prediction. Limits for another
    /// arm, other gains, another method or another period are not used.
    fn limits(&self) -> (f64, f64) {
        let infinite = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        match &self.limit.known {
            Some((of, limits)) if resemble(of, &ControlLoop::in_force(&self.simulation)) => {
                (infinite(limits.timestep), infinite(limits.period))
            }
            _ => (f64::NAN, f64::NAN),
        }
    }

    /// The largest stable timestep \[s\] at the present control period, as predicted.
    pub(super) fn timestep_limit(&self) -> f64 {
        self.limits().0
    }

    /// The largest stable control period \[s\], as predicted.
    pub(super) fn period_limit(&self) -> f64 {
        self.limits().1
    }

    /// The time between two runs of the law, in whole steps \[s\].
    pub(super) fn effective_period(&self) -> f64 {
        let period = self.simulation.control_period();
        period.effective(self.simulation.timestep())
    }

    /// The coming motion of the arm, and its largest timestep.
    pub(super) fn motion(&self) -> Motion {
        let control = ControlLoop::in_force(&self.simulation);
        Motion::ahead(&control, self.simulation.state())
    }

    /// The exceeded limit. If both are exceeded it is the control period's, because no timestep corrects that.
    fn exceeded(&self) -> Option<Exceeded> {
        let simulation = &self.simulation;
        let (timestep, (limit, period_limit)) = (simulation.timestep(), self.limits());
        let effective = self.effective_period();
        let is_sampled = simulation.pid().is_enabled() && effective > timestep;
        let motion = self.motion();
        if is_sampled && effective > period_limit {
            Some(Exceeded::Period)
        } else if motion.timestep < timestep && (limit.is_nan() || motion.timestep < limit) {
            Some(Exceeded::Motion(motion))
        } else {
            (timestep > limit).then_some(Exceeded::Timestep)
        }
    }

    /// The warning about the present timestep or control period, if one exceeds its limit.
    pub(super) fn limit_warning(&self) -> Option<String> {
        let simulation = &self.simulation;
        let (timestep, (limit, period_limit)) = (simulation.timestep(), self.limits());
        let method = simulation.method();
        let condition = if simulation.pid().is_enabled() {
            "at the present setpoint"
        } else {
            "with the controller off"
        };
        let effective = self.effective_period();
        let over = |value: f64, limit: f64| {
            let (value, limit) = (shown_against(value, limit), shown_against(limit, value));
            format!("{value} s exceeds {limit} s")
        };
        Some(match self.exceeded()? {
            Exceeded::Period => format!(
                "the control period {}, the predicted stability limit of the controller {condition}",
                over(effective, period_limit)
            ),
            Exceeded::Motion(motion) => format!(
                "the timestep {}, the predicted limit of {method} for a motion of up to {} rad/s",
                over(timestep, motion.timestep),
                Shown(motion.speed)
            ),
            Exceeded::Timestep if limit == 0.0 => {
                format!("no stable timestep is predicted for {method} {condition}")
            }
            Exceeded::Timestep => {
                let is_default = simulation.control_period() == ControlPeriod::default();
                let period = if is_default {
                    String::new()
                } else {
                    format!(" with a control period of {} s", Shown(effective))
                };
                format!(
                    "the timestep {}, the predicted stability limit of {method} {condition}{period}",
                    over(timestep, limit)
                )
            }
        })
    }

    /// The message of `/arm_sim/error_estimate`, for the next step, paused or not.
    pub(super) fn error_estimate(&self) -> ErrorEstimateMessage<'static> {
        let estimate = estimate(&self.simulation);
        self.world.count_estimate();
        ErrorEstimateMessage {
            method: self.simulation.method().name(),
            timestep: self.simulation.timestep(),
            local_error: estimate.map_or(f64::NAN, |one| one.local_error),
            velocity_error: estimate.map_or(f64::NAN, |one| one.velocity_error),
            error_per_second: estimate.map_or(f64::NAN, |one| one.error_per_second),
            predicted_limit: self.timestep_limit(),
        }
    }
}
