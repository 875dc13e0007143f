//! The arm judges its own clocks: how large timestep and control period may be at the present setpoint, and by how much
//! each step is off.
//!
//! The limit is predicted by the node `study`, on its workers, and kept here until the control loop is another one. It
//! is looked after at publishing ticks, and only while somebody subscribes to a topic that shows it. With the
//! controller off the loop in force is the arm alone. Gains and setpoint have no effect on it.
//!
//! **Invariant:** nothing is ever refused or changed because of a limit or an error; they are only published.

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

/// Least time between two predictions for one arm with one set of gains, a millisecond of a worker each: setpoints may
/// come by the thousand a second.
pub const LEAST_PAUSE: Duration = Duration::from_millis(100);

/// A limit that is exceeded.
enum Exceeded {
    /// The control period is beyond the controller's limit.
    Period,
    /// The timestep is beyond the limit of this motion.
    Motion(Motion),
    /// The timestep is beyond the method's limit.
    Timestep,
}

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// At a tick: tells at once if a warning comes or goes.
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

    /// Whether a goal or a setpoint waits for the controller to be switched on.
    pub(super) fn is_held_up(&self) -> bool {
        let is_meant_to_move = self.goals.is_tracked() || self.goals.setpoint_waits;
        is_meant_to_move && !self.simulation.pid().is_enabled()
    }

    /// The loop in force, if its limit has to be predicted: not if that is known, on its way, or wanted by nobody.
    /// The caller has [`LiveArm::keep_limit`] hear of the prediction.
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
        self.telemetry.wants(Topic::Diagnostics) || self.telemetry.wants(Topic::ErrorEstimate)
    }

    /// The latest predictions \[s\], of the timestep and of the control period: infinite where nothing limits, NaN
    /// while there are none. Limits for an earlier setpoint will do until the next are there. Limits for another
    /// arm, other gains, another method or another period say nothing.
    fn limits(&self) -> (f64, f64) {
        let infinite = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        match &self.limit.known {
            Some((of, limits)) if resemble(of, &ControlLoop::in_force(&self.simulation)) => {
                (infinite(limits.timestep), infinite(limits.period))
            }
            _ => (f64::NAN, f64::NAN),
        }
    }

    /// The largest timestep that is predicted to be stable \[s\], at the present control period.
    pub(super) fn timestep_limit(&self) -> f64 {
        self.limits().0
    }

    /// The largest control period that is predicted to be stable \[s\].
    pub(super) fn period_limit(&self) -> f64 {
        self.limits().1
    }

    /// The time between two runs of the law, in whole steps \[s\].
    pub(super) fn effective_period(&self) -> f64 {
        let period = self.simulation.control_period();
        period.effective(self.simulation.timestep())
    }

    /// The motion that is ahead of the arm, and its largest timestep.
    pub(super) fn motion(&self) -> Motion {
        let control = ControlLoop::in_force(&self.simulation);
        Motion::ahead(&control, self.simulation.state())
    }

    /// The limit that is exceeded. Where both clocks are too slow it is the period's, which no timestep mends.
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

    /// The warning about the present timestep or control period, if a limit calls for one.
    pub(super) fn limit_warning(&self) -> Option<String> {
        let simulation = &self.simulation;
        let (timestep, (limit, period_limit)) = (simulation.timestep(), self.limits());
        let method = simulation.method();
        let place = if simulation.pid().is_enabled() {
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
                "the control period {}, up to which the controller is predicted to be stable {place}",
                over(effective, period_limit)
            ),
            Exceeded::Motion(motion) => format!(
                "the timestep {}, up to which {method} is predicted to carry a motion of {} rad/s",
                over(timestep, motion.timestep),
                Shown(motion.speed)
            ),
            Exceeded::Timestep if limit == 0.0 => {
                format!("{method} is predicted to be unstable at every timestep {place}")
            }
            Exceeded::Timestep => {
                let is_default = simulation.control_period() == ControlPeriod::default();
                let period = if is_default {
                    String::new()
                } else {
                    format!(" with a control period of {} s", Shown(effective))
                };
                format!(
                    "the timestep {}, up to which {method} is predicted to be stable {place}{period}",
                    over(timestep, limit)
                )
            }
        })
    }

    /// The message of `/arm_sim/error_estimate`: of the step that is about to be taken, paused or not.
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
