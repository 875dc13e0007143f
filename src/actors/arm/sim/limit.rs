//! The arm judges its own timestep: how large it may be at the present setpoint, and by how much each step is off.
//!
//! The limit is predicted by the node `study`, on its workers, and kept here until the control loop is another one. It
//! is looked after at publishing ticks, and only while somebody subscribes to a topic that shows it. With the
//! controller off the loop in force is the arm left to itself, whatever gains and setpoint wait to be switched on.
//!
//! **Invariant:** nothing is ever refused or changed because of a limit or an error; they are only published.

use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

use super::messages::{ArmSettings, Consult, HeldLimit, Present};
use super::node::ArmSim;
use super::state::limit::{resemble, share_limit};
use crate::protocol::catalog::Topic;
use crate::protocol::messages::ErrorEstimateMessage;
use crate::study::control_loop::ControlLoop;
use crate::study::error_estimate::estimate;
use crate::study::motion::Motion;

/// Least time between two predictions for one arm with one set of gains, a millisecond of a worker each: setpoints may
/// come by the thousand a second.
pub const LEAST_PAUSE: Duration = Duration::from_millis(100);

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ArmSettings<N>> for ArmSim<N> {
    type Result = Present<N>;

    fn handle(&mut self, _: ArmSettings<N>, ctx: &mut Context<Self>) -> Present<N> {
        self.count_message(ctx);
        Present {
            control: ControlLoop::of(&self.simulation),
            state: *self.simulation.state(),
        }
    }
}

impl<const N: usize> Handler<Consult<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Consult(study): Consult<N>, _: &mut Context<Self>) {
        self.limit.study = Some(study);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// At a tick: has the limit predicted anew if the loop has changed, and tells at once if the warning comes or goes.
    pub(super) fn watch_limit(&mut self, ctx: &mut Context<Self>) {
        self.ask_limit(ctx);
        let limit = self.timestep_limit();
        if !self.wants_limit() || limit.is_nan() {
            return;
        }
        let exceeded = self.simulation.timestep() > limit.min(self.motion().timestep);
        if exceeded != self.limit.warned {
            self.limit.warned = exceeded;
            self.publish_diagnostics();
        }
    }

    /// Asks for the limit of the loop in force, unless it is known, on its way, or wanted by nobody.
    pub(super) fn ask_limit(&mut self, ctx: &mut Context<Self>) {
        if self.limit.waiting || !self.wants_limit() {
            return;
        }
        let present = ControlLoop::in_force(&self.simulation);
        let settled = self.limit.asked.is_some_and(|(control, asked_at)| {
            let soon = asked_at.elapsed() < LEAST_PAUSE;
            share_limit(&control, &present) || (soon && resemble(&control, &present))
        });
        let Some(study) = self.limit.study.as_ref().filter(|_| !settled) else {
            return;
        };
        let answer = study.send(HeldLimit(present)).into_actor(self);
        self.limit.asked = Some((present, Instant::now()));
        self.limit.waiting = true;
        ctx.spawn(answer.map(move |answer, arm, _| {
            arm.limit.waiting = false;
            if let Ok(Some(limit)) = answer {
                arm.limit.known = Some((present, limit));
            }
        }));
    }

    fn wants_limit(&self) -> bool {
        self.telemetry.wants(Topic::Diagnostics) || self.telemetry.wants(Topic::ErrorEstimate)
    }

    /// The latest prediction \[s\]: infinite where nothing limits, NaN while there is none. One for an earlier setpoint
    /// will do until the next is there; one for another arm, other gains or another method says nothing.
    pub(super) fn timestep_limit(&self) -> f64 {
        match &self.limit.known {
            Some((of, limit)) if resemble(of, &ControlLoop::in_force(&self.simulation)) => *limit,
            _ => f64::NAN,
        }
    }

    /// The motion that is ahead of the arm, and the timestep that it bears.
    pub(super) fn motion(&self) -> Motion {
        let control = ControlLoop::in_force(&self.simulation);
        Motion::ahead(&control, self.simulation.state())
    }

    /// The warning about the present timestep, if the smaller of the two limits calls for one.
    pub(super) fn limit_warning(&self) -> Option<String> {
        let (timestep, limit) = (self.simulation.timestep(), self.timestep_limit());
        let motion = self.motion();
        if motion.timestep < timestep && (limit.is_nan() || motion.timestep < limit) {
            let method = self.simulation.method();
            let Motion {
                speed,
                timestep: bears,
            } = motion;
            return Some(format!(
                "the timestep {timestep:?} s exceeds {bears:.2e} s, up to which {method} is predicted to carry a \
                 motion of {speed:.1} rad/s"
            ));
        }
        let method = self.simulation.method();
        let place = if self.simulation.pid().is_enabled() {
            "at the present setpoint"
        } else {
            "with the controller off"
        };
        let says = if limit == 0.0 {
            format!("{method} is predicted to be unstable at every timestep {place}")
        } else {
            format!(
                "the timestep {timestep:?} s exceeds {limit:?} s, up to which {method} is predicted to be stable \
                 {place}"
            )
        };
        (timestep > limit).then_some(says)
    }

    /// The message of `/arm_sim/error_estimate`: of the step that is about to be taken, paused or not.
    pub(super) fn error_estimate(&self) -> ErrorEstimateMessage<'static> {
        let estimate = estimate(&self.simulation);
        self.telemetry.count_estimate();
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
