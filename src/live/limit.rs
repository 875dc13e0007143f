//! The limits of the arm's timestep and control period at the present setpoint, and the error estimate of a step.
//!
//! The node `study` predicts the limit on its workers. It is kept here until the control loop changes. Publishing
//! ticks check it, only while a topic that shows it has subscribers. With the controller off the active loop is the
//! free arm, without gains and setpoint.
//!
//! **Invariant:** limits and errors are only published. Nothing is refused or changed because of them.

use std::time::Duration;

use crate::math::shown::{Shown, shown_against};
use crate::math::simulation::{ControlPeriod, Simulation};
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

/// The last predicted limit.
#[derive(Default)]
pub(crate) struct LimitWatch<const N: usize> {
    /// The loop of the last request, and its time.
    asked: Option<(ControlLoop<N>, Duration)>,
    /// Whether the answer is still pending.
    waiting: bool,
    /// The latest answer and its loop.
    known: Option<(ControlLoop<N>, ClockLimits)>,
    /// The last published warnings: whether a timestep or a period was too long, and whether a goal waited for
    /// the controller.
    warned: (bool, bool),
}

impl<const N: usize> LimitWatch<N> {
    /// Returns whether a warning has appeared or ended since the last call.
    pub(super) fn note_warnings(&mut self, simulation: &Simulation<N>, is_held_up: bool) -> bool {
        let is_known = !self.limits(simulation).0.is_nan();
        let exceeded = if is_known {
            self.exceeded(simulation).is_some()
        } else {
            self.warned.0
        };
        let warned = (exceeded, is_held_up);
        std::mem::replace(&mut self.warned, warned) != warned
    }

    /// The active loop, if its limit is neither known nor requested already.
    pub(super) fn next_prediction(
        &mut self,
        simulation: &Simulation<N>,
        now: Duration,
    ) -> Option<ControlLoop<N>> {
        if self.waiting {
            return None;
        }
        let present = ControlLoop::in_force(simulation);
        let settled = self.asked.is_some_and(|(control, asked_at)| {
            let soon = now.saturating_sub(asked_at) < LEAST_PAUSE;
            share_limit(&control, &present) || (soon && resemble(&control, &present))
        });
        if settled {
            return None;
        }
        self.asked = Some((present, now));
        self.waiting = true;
        Some(present)
    }

    /// The prediction for a loop, if there is one.
    pub(super) fn keep(&mut self, of: ControlLoop<N>, limits: Option<ClockLimits>) {
        self.waiting = false;
        if let Some(limits) = limits {
            self.known = Some((of, limits));
        }
    }

    /// The largest stable timestep at the present control period and the largest stable control period, as predicted
    /// \[s\]: infinite if nothing limits, NaN while there are none. Limits for an earlier setpoint are used until the
    /// next prediction. Limits for another arm, other gains, another method or another period are not used.
    pub(super) fn limits(&self, simulation: &Simulation<N>) -> (f64, f64) {
        let infinite = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        match &self.known {
            Some((of, limits)) if resemble(of, &ControlLoop::in_force(simulation)) => {
                (infinite(limits.timestep), infinite(limits.period))
            }
            _ => (f64::NAN, f64::NAN),
        }
    }

    /// The exceeded limit. If both are exceeded it is the control period's, because no timestep corrects that.
    fn exceeded(&self, simulation: &Simulation<N>) -> Option<Exceeded> {
        let (timestep, (limit, period_limit)) = (simulation.timestep(), self.limits(simulation));
        let effective = effective_period(simulation);
        let is_sampled = simulation.pid().is_enabled() && effective > timestep;
        let motion = motion(simulation);
        if is_sampled && effective > period_limit {
            Some(Exceeded::Period)
        } else if motion.timestep < timestep && (limit.is_nan() || motion.timestep < limit) {
            Some(Exceeded::Motion(motion))
        } else {
            (timestep > limit).then_some(Exceeded::Timestep)
        }
    }

    /// The warning about the present timestep or control period, if one exceeds its limit.
    pub(super) fn warning(&self, simulation: &Simulation<N>) -> Option<String> {
        let (timestep, (limit, period_limit)) = (simulation.timestep(), self.limits(simulation));
        let method = simulation.method();
        let condition = if simulation.pid().is_enabled() {
            "at the present setpoint"
        } else {
            "with the controller off"
        };
        let effective = effective_period(simulation);
        let over = |value: f64, limit: f64| {
            let (value, limit) = (shown_against(value, limit), shown_against(limit, value));
            format!("{value} s exceeds {limit} s")
        };
        Some(match self.exceeded(simulation)? {
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
    pub(super) fn error_estimate(
        &self,
        simulation: &Simulation<N>,
    ) -> ErrorEstimateMessage<'static> {
        let estimate = estimate(simulation);
        ErrorEstimateMessage {
            method: simulation.method().name(),
            timestep: simulation.timestep(),
            local_error: estimate.map_or(f64::NAN, |one| one.local_error),
            velocity_error: estimate.map_or(f64::NAN, |one| one.velocity_error),
            error_per_second: estimate.map_or(f64::NAN, |one| one.error_per_second),
            predicted_limit: self.limits(simulation).0,
        }
    }
}

/// The time between two runs of the law, in whole steps \[s\].
pub(super) fn effective_period<const N: usize>(simulation: &Simulation<N>) -> f64 {
    let period = simulation.control_period();
    period.effective(simulation.timestep())
}

/// The coming motion of the arm, and its largest timestep.
pub(super) fn motion<const N: usize>(simulation: &Simulation<N>) -> Motion {
    let control = ControlLoop::in_force(simulation);
    Motion::ahead(&control, simulation.state())
}

/// Whether two loops have the same limit. It depends on everything except the timestep.
fn share_limit<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.setpoint == other.setpoint && resemble(one, other)
}

/// Whether two loops differ at most in setpoint and timestep.
fn resemble<const N: usize>(one: &ControlLoop<N>, other: &ControlLoop<N>) -> bool {
    one.arm == other.arm
        && one.gains == other.gains
        && one.method == other.method
        && one.period == other.period
}
