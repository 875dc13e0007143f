//! The arm's states, and `/diagnostics`.
//!
//! **Invariant:** a message is made only for a topic with subscribers, and its states are written when it is sent.

use std::time::Duration;

use bytes::Bytes;

use super::counts::{Counts, energy};
use super::goals::{Goals, Obstacle};
use super::limit::{LimitWatch, effective_period, motion};
use super::loads::Loads;
use crate::math::arm::State;
use crate::math::pacer::CATCH_UP;
use crate::math::shown::Shown;
use crate::math::simulation::Simulation;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::scene::WORLD;
use crate::protocol::messages::{
    self, DiagnosticArray, DiagnosticStatus, Header, JointState, KeyValue, Stamp,
};
use crate::services::arm::joint_names;

/// Writes a state with the efforts of the latest step \[N m\].
pub(super) fn joint_state<const N: usize>(
    topic: Topic,
    stamp: Stamp,
    state: &State<N>,
    effort: &[f64; N],
) -> Bytes {
    let message = JointState {
        header: header(stamp),
        name: &joint_names::<N>(),
        position: &state.position,
        velocity: &state.velocity,
        effort,
    };
    messages::publish(topic.name(), &message)
}

/// The parts of the arm and of the gateway that `/diagnostics` shows.
pub(super) struct Health<'a, const N: usize> {
    pub(super) simulation: &'a Simulation<N>,
    pub(super) is_paused: bool,
    pub(super) counts: &'a Counts,
    pub(super) goals: &'a Goals<N>,
    pub(super) loads: &'a Loads<N>,
    pub(super) limit: &'a LimitWatch<N>,
    /// By the clock of the simulation time.
    pub(super) now: Duration,
    /// The number of clients and of dropped messages.
    pub(super) clients: (u64, u64),
}

impl<const N: usize> Health<'_, N> {
    /// The message of `/diagnostics`.
    pub(super) fn diagnostics(&self) -> DiagnosticArray<'static> {
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
            None if self.is_paused => (level, "paused", "paused".to_owned()),
            None => (level, "running", "running".to_owned()),
        };
        let energy = energy(self.simulation);
        let rates = self.counts.window.rates(self.now);
        let at_limit = self.loads.shares(rates.is_some());
        let rates = rates.unwrap_or(self.counts.last_rates);
        let (timestep_limit, period_limit) = self.limit.limits(self.simulation);
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
            ("control_period", effective_period(self.simulation)),
            ("control_period_limit", period_limit),
            ("timestep_limit", timestep_limit),
            ("timestep_limit_motion", motion(self.simulation).timestep),
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
        let lags = !self.is_paused && self.counts.lags();
        let late = lags.then(|| {
            let behind = CATCH_UP.as_millis() / 2;
            format!("the arm is more than {behind} ms behind wall time")
        });
        let is_held_up = self.goals.are_held_up(self.simulation);
        let held_up = is_held_up.then(|| Obstacle::ControllerOff.to_string());
        let warnings = [self.limit.warning(self.simulation), held_up, late];
        warnings.into_iter().flatten().collect()
    }

    fn gateway_status(&self) -> DiagnosticStatus<'static> {
        let (connections, dropped) = self.clients;
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
