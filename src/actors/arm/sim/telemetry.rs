//! The arm's topics: `/joint_states` and `/clock` at every tick, `/arm_sim/error_estimate` at every sixth, `/diagnostics`
//! once a second and at every change.
//!
//! **Invariant:** nothing is reckoned for a topic that nobody subscribes to; what is published is written elsewhere.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use serde::Serialize;
use tokio::time::Instant;

use super::{ArmSim, PUBLISH_RATE};
use crate::actors::gateway::gauges::Gauges;
use crate::actors::node::{Frame, Publish};
use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::dynamics;
use crate::math::pacer::CATCH_UP;
use crate::math::simulation::Simulation;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::{
    self, Clock, DiagnosticArray, DiagnosticStatus, Header, JointState, KeyValue, Stamp,
};

/// The frame in which everything is expressed.
const FRAME_ID: &str = "world";
/// Rates are given over at least this long: over less they say nothing.
const SHORTEST_WINDOW: Duration = Duration::from_millis(250);

/// Ticks between two messages of `/arm_sim/error_estimate`, which so comes at 10 Hz: it is for reading, not for control.
const ESTIMATE_TICKS: u64 = 6;

/// Counts between two messages of `/diagnostics`, and the topics that somebody wants.
pub(super) struct Telemetry {
    gauges: Arc<Gauges>,
    wanted: Vec<Topic>,
    /// Publishing ticks so far.
    ticks: u64,
    /// Energy when it was last changed from outside \[J\]: what the drift is measured from.
    energy_reference: f64,
    window: Window,
    /// Wall time that the latest wake-up left owed \[s\].
    owed: f64,
    /// Rates over the window before, for a message that comes early in the present one.
    last_rates: Rates,
}

/// Work since `began`.
struct Window {
    began: Instant,
    steps: u64,
    /// Simulation time \[s\].
    simulated: f64,
    /// The longest batch since the last message.
    longest: Batch,
}

/// The steps of one wake-up.
#[derive(Clone, Copy, Default)]
struct Batch {
    steps: u64,
    took: Duration,
}

impl Batch {
    /// Time per step \[s\]; 0 where there was none.
    fn step_time(self) -> f64 {
        self.took.as_secs_f64() / in_f64(self.steps.max(1))
    }
}

#[derive(Clone, Copy, Default)]
struct Rates {
    real_time_factor: f64,
    steps_per_second: f64,
}

impl Telemetry {
    pub(super) fn new<const N: usize>(gauges: Arc<Gauges>, simulation: &Simulation<N>) -> Self {
        Self {
            gauges,
            wanted: Vec::new(),
            ticks: 0,
            energy_reference: energy(simulation),
            window: Window::new(),
            owed: 0.0,
            last_rates: Rates::default(),
        }
    }

    pub(super) fn set_wanted(&mut self, topic: Topic, wanted: bool) {
        self.wanted.retain(|&one| one != topic);
        if wanted {
            self.wanted.push(topic);
        }
    }

    pub(super) fn wants(&self, topic: Topic) -> bool {
        self.wanted.contains(&topic)
    }

    /// Counts an estimate of the local error.
    pub(super) fn count_estimate(&self) {
        self.gauges.add_estimate();
    }

    /// Notes a batch of steps and the processor's time that it took.
    pub(super) fn stepped(&mut self, steps: u64, took: Duration, timestep: f64) {
        if steps == 0 {
            return;
        }
        self.window.steps += steps;
        self.window.simulated += in_f64(steps) * timestep;
        if took > self.window.longest.took {
            self.window.longest = Batch { steps, took };
        }
    }

    /// Notes how many steps a wake-up left owed.
    pub(super) fn owes(&mut self, steps: u64, timestep: f64) {
        self.owed = in_f64(steps) * timestep;
    }

    /// Whether the arm lags so far behind wall time that it soon has to drop some, or does so already.
    fn lags(&self) -> bool {
        self.owed > CATCH_UP.as_secs_f64() / 2.0
    }
}

impl Window {
    fn new() -> Self {
        Self {
            began: Instant::now(),
            steps: 0,
            simulated: 0.0,
            longest: Batch::default(),
        }
    }

    /// Rates since the window began; `None` while it is too short to tell.
    fn rates(&self) -> Option<Rates> {
        let elapsed = self.began.elapsed();
        (elapsed >= SHORTEST_WINDOW).then(|| Rates {
            real_time_factor: self.simulated / elapsed.as_secs_f64(),
            steps_per_second: in_f64(self.steps) / elapsed.as_secs_f64(),
        })
    }
}

impl<const N: usize> ArmSim<N> {
    /// Publishes what is due at a tick.
    pub(super) fn publish_state(&mut self) {
        self.telemetry.ticks += 1;
        let stamp = Stamp::from_seconds(self.simulation.time());
        if self.telemetry.wants(Topic::JointStates) {
            self.publish_joint_state(stamp);
        }
        if self.telemetry.wants(Topic::Clock) {
            self.publish(Topic::Clock, move || Clock { clock: stamp });
        }
        self.publish_frames(stamp);
        if self.telemetry.wants(Topic::ErrorEstimate)
            && self.telemetry.ticks.is_multiple_of(ESTIMATE_TICKS)
        {
            let estimate = self.error_estimate();
            self.publish(Topic::ErrorEstimate, move || estimate);
        }
        if self.telemetry.ticks.is_multiple_of(u64::from(PUBLISH_RATE)) {
            self.publish_diagnostics();
            self.telemetry.last_rates = self.telemetry.window.rates().unwrap_or_default();
            self.telemetry.window = Window::new();
        }
    }

    /// `/diagnostics`, if anybody wants it.
    pub(super) fn publish_diagnostics(&mut self) {
        if self.telemetry.wants(Topic::Diagnostics) {
            let diagnostics = self.diagnostics();
            self.publish(Topic::Diagnostics, move || diagnostics);
            self.telemetry.window.longest = Batch::default();
        }
    }

    /// The drift counts from the present energy.
    pub(super) fn restart_energy_drift(&mut self) {
        self.telemetry.energy_reference = energy(&self.simulation);
    }

    /// Publishes the message that `make` makes; it is made and written by the registry, not on this thread.
    pub(super) fn publish<M: Serialize>(
        &self,
        topic: Topic,
        make: impl FnOnce() -> M + Send + 'static,
    ) {
        self.publish_frame(topic, move || messages::publish(topic.name(), &make()));
    }

    fn publish_frame(&self, topic: Topic, write: impl FnOnce() -> Bytes + Send + 'static) {
        let frame = Frame::unwritten(write);
        self.publish.do_send(Publish { topic, frame });
    }

    fn header(stamp: Stamp) -> Header<'static> {
        Header {
            stamp,
            frame_id: FRAME_ID,
        }
    }

    fn publish_joint_state(&self, stamp: Stamp) {
        let State { position, velocity } = *self.simulation.state();
        let (name, effort) = (self.joint_names, *self.simulation.effort());
        self.publish_frame(Topic::JointStates, move || {
            let message = JointState {
                header: Self::header(stamp),
                name: &name,
                position: &position,
                velocity: &velocity,
                effort: &effort,
            };
            messages::publish(Topic::JointStates.name(), &message)
        });
    }

    fn diagnostics(&self) -> DiagnosticArray<'static> {
        let stamp = Stamp::from_seconds(self.simulation.time());
        DiagnosticArray {
            header: Self::header(stamp),
            status: vec![self.arm_status(), self.gateway_status()],
        }
    }

    fn arm_status(&self) -> DiagnosticStatus<'static> {
        let warnings = self.warnings();
        let level = u8::from(!warnings.is_empty());
        let (level, state, message) = match self.simulation.divergence() {
            Some(divergence) => {
                let message = format!(
                    "diverged: step {} from t = {} s was not finite and was not taken; /arm_sim/reset clears this",
                    divergence.step, divergence.time
                );
                (2, "diverged", message)
            }
            None if self.paused => (level, "paused", "paused".to_owned()),
            None => (level, "running", "running".to_owned()),
        };
        let energy = energy(&self.simulation);
        let rates = self
            .telemetry
            .window
            .rates()
            .unwrap_or(self.telemetry.last_rates);
        let numbers = [
            ("sim_time", self.simulation.time()),
            ("real_time_factor", rates.real_time_factor),
            ("steps_per_second", rates.steps_per_second),
            ("energy", energy),
            ("energy_drift", energy - self.telemetry.energy_reference),
            ("max_step_time", self.telemetry.window.longest.step_time()),
            ("timestep_limit", self.timestep_limit()),
            ("timestep_limit_motion", self.motion().timestep),
        ];
        let mut values = vec![entry("state", state)];
        // Debug prints what is huge or tiny with an exponent.
        values.extend(numbers.map(|(key, value)| entry(key, format!("{value:?}"))));
        let setpoint = self.simulation.pid().setpoint().position;
        values.push(entry("setpoint", format!("{setpoint:?}")));
        values.push(entry("warning", warnings.join("; ")));
        DiagnosticStatus {
            level,
            name: "arm_sim",
            message,
            hardware_id: "",
            values,
        }
    }

    /// Warnings about an arm that goes on all the same.
    fn warnings(&self) -> Vec<String> {
        let lags = !self.paused && self.telemetry.lags();
        let late = lags.then(|| {
            let behind = CATCH_UP.as_millis() / 2;
            format!("the arm is more than {behind} ms behind wall time")
        });
        self.limit_warning().into_iter().chain(late).collect()
    }

    fn gateway_status(&self) -> DiagnosticStatus<'static> {
        let gauges = &self.telemetry.gauges;
        let values = vec![
            entry("connections", gauges.connections().to_string()),
            entry("messages_dropped", gauges.messages_dropped().to_string()),
            entry("clients_cut_off", gauges.memory().cut_off().to_string()),
            entry("bytes_held", gauges.memory().held().to_string()),
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

fn energy<const N: usize>(simulation: &Simulation<N>) -> f64 {
    dynamics::energy(simulation.arm(), simulation.state())
}

fn entry(key: &str, value: impl Into<String>) -> KeyValue<'_> {
    KeyValue {
        key,
        value: value.into(),
    }
}
