//! The arm's topics: `/joint_states`, `/joint_states_measured` and `/clock` at every tick, `/arm_sim/error_estimate` at every sixth,
//! `/diagnostics` once a second and at every change.
//!
//! **Invariant:** nothing is computed for a topic without subscribers. Messages are encoded elsewhere.

use serde::Serialize;

use super::counts::{WakeUp, energy};
use super::{LiveArm, Obstacle, PUBLISH_RATE, REST_TICKS, World};
use crate::math::arm::State;
use crate::math::pacer::CATCH_UP;
use crate::math::shown::Shown;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::scene::WORLD;
use crate::protocol::messages::{
    self, Clock, DiagnosticArray, DiagnosticStatus, Header, JointState, KeyValue, Stamp,
};
use crate::services::arm::joint_names;

/// Ticks between two messages of `/arm_sim/error_estimate`. Its rate is 10 Hz, because people read it.
const ESTIMATE_TICKS: u64 = 6;

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// Publishes the messages that are due at a tick, after the steps until then.
    pub fn tick(&mut self) {
        self.watch_warnings();
        self.publish_state();
        self.tell_state();
    }

    /// Counts ticks at which there was nothing to publish.
    pub const fn skip_ticks(&mut self, count: u64) {
        self.counts.ticks += count;
    }

    /// The number of ticks until the next one at which the arm must wake.
    #[must_use]
    pub fn ticks_to_wake(&self) -> u64 {
        match self.is_observed() {
            true => 1,
            false => REST_TICKS - self.counts.ticks % REST_TICKS,
        }
    }

    fn publish_state(&mut self) {
        self.counts.ticks += 1;
        let stamp = Stamp::from_seconds(self.simulation.time());
        if self.counts.wants(Topic::JointStates) {
            self.publish_joint_state(Topic::JointStates, stamp, *self.simulation.state());
        }
        if self.counts.wants(Topic::MeasuredStates) {
            self.publish_joint_state(Topic::MeasuredStates, stamp, self.simulation.measured());
        }
        if self.counts.wants(Topic::Clock) {
            self.publish(Topic::Clock, move || Clock { clock: stamp });
        }
        self.publish_transforms(stamp);
        if self.counts.wants(Topic::ErrorEstimate)
            && self.counts.ticks.is_multiple_of(ESTIMATE_TICKS)
        {
            let estimate = self.error_estimate();
            self.publish(Topic::ErrorEstimate, move || estimate);
        }
        if self.counts.ticks.is_multiple_of(u64::from(PUBLISH_RATE)) {
            self.publish_diagnostics();
            self.counts.end_window(self.world.now(), self.stands());
            self.loads.end_window();
        }
    }

    /// Publishes that the arm may move again. Rates count from here.
    pub(super) fn publish_new_state(&mut self) {
        self.counts.restart_window(self.world.now());
        self.publish_diagnostics();
    }

    /// Publishes `/diagnostics`, if it has subscribers.
    pub(super) fn publish_diagnostics(&mut self) {
        if self.counts.wants(Topic::Diagnostics) {
            let diagnostics = self.diagnostics();
            self.publish(Topic::Diagnostics, move || diagnostics);
            self.counts.window.longest = WakeUp::default();
        }
    }

    /// Measures the drift from the present energy.
    pub(super) fn restart_energy_drift(&mut self) {
        self.counts.energy_reference = energy(&self.simulation);
        self.loads.friction = 0.0;
    }

    /// Publishes the message of `make`, which is called when the frame is written.
    pub fn publish<M: Serialize>(&self, topic: Topic, make: impl FnOnce() -> M + Send + 'static) {
        self.world
            .publish(topic, move || messages::publish(topic.name(), &make()));
    }

    fn publish_joint_state(&self, topic: Topic, stamp: Stamp, state: State<N>) {
        let State { position, velocity } = state;
        let (name, effort) = (joint_names::<N>(), *self.simulation.effort());
        self.world.publish(topic, move || {
            let message = JointState {
                header: header(stamp),
                name: &name,
                position: &position,
                velocity: &velocity,
                effort: &effort,
            };
            messages::publish(topic.name(), &message)
        });
    }

    fn diagnostics(&self) -> DiagnosticArray<'static> {
        let stamp = Stamp::from_seconds(self.simulation.time());
        DiagnosticArray {
            header: header(stamp),
            status: vec![self.arm_status(), self.gateway_status()],
        }
    }

    fn arm_status(&self) -> DiagnosticStatus<'static> {
        let warnings = self.warnings();
        let level = u8::from(!warnings.is_empty());
        let (level, state, message) = match self.simulation.divergence() {
            Some(divergence) => {
                let message = format!(
                    "diverged: step {} from t = {} s was not finite and was not taken; {} clears this",
                    divergence.step,
                    Shown(divergence.time),
                    Service::Reset.name()
                );
                (2, "diverged", message)
            }
            None if self.paused => (level, "paused", "paused".to_owned()),
            None => (level, "running", "running".to_owned()),
        };
        let energy = energy(&self.simulation);
        let rates = self.counts.window.rates(self.world.now());
        let at_limit = self.loads.shares(rates.is_some());
        let rates = rates.unwrap_or(self.counts.last_rates);
        let numbers = [
            ("sim_time", self.simulation.time()),
            ("real_time_factor", rates.real_time_factor),
            ("steps_per_second", rates.steps_per_second),
            ("energy", energy),
            (
                "energy_drift",
                energy + self.loads.friction - self.counts.energy_reference,
            ),
            ("friction_loss", self.loads.friction),
            ("max_step_time", self.counts.window.longest.step_time()),
            ("control_period", self.effective_period()),
            ("control_period_limit", self.period_limit()),
            ("timestep_limit", self.timestep_limit()),
            ("timestep_limit_motion", self.motion().timestep),
        ];
        let mut values = vec![entry("state", state)];
        // The Debug format writes very large and very small numbers with an exponent.
        values.extend(numbers.map(|(key, value)| entry(key, format!("{value:?}"))));
        let setpoint = self.simulation.pid().setpoint().position;
        values.push(entry("setpoint", format!("{setpoint:?}")));
        values.push(entry("effort_at_limit", format!("{at_limit:?}")));
        values.push(entry("warning", warnings.join("; ")));
        DiagnosticStatus {
            level,
            name: "arm_sim",
            message,
            hardware_id: "",
            values,
        }
    }

    /// Warnings about a running arm.
    fn warnings(&self) -> Vec<String> {
        let lags = !self.paused && self.counts.lags();
        let late = lags.then(|| {
            let behind = CATCH_UP.as_millis() / 2;
            format!("the arm is more than {behind} ms behind wall time")
        });
        let held_up = self
            .is_held_up()
            .then(|| Obstacle::ControllerOff.to_string());
        let warnings = [self.limit_warning(), held_up, late];
        warnings.into_iter().flatten().collect()
    }

    fn gateway_status(&self) -> DiagnosticStatus<'static> {
        let (connections, dropped) = self.world.clients();
        let values = vec![
            entry("connections", connections.to_string()),
            entry("messages_dropped", dropped.to_string()),
        ];
        let message = "running".to_owned();
        DiagnosticStatus {
            level: 0,
            name: "gateway",
            message,
            hardware_id: "",
            values,
        }
    }
}

fn header(stamp: Stamp) -> Header {
    Header {
        stamp,
        frame_id: WORLD,
    }
}

fn entry(key: &str, value: impl Into<String>) -> KeyValue<'_> {
    KeyValue {
        key,
        value: value.into(),
    }
}
