//! Counts between two messages of `/diagnostics`, and the topics that somebody wants.
//!
//! **Invariant:** rates are of one window, which is never shorter than they can be told from.

use std::time::Duration;

use crate::math::count::in_f64;
use crate::math::dynamics;
use crate::math::pacer::CATCH_UP;
use crate::math::simulation::Simulation;
use crate::protocol::catalog::Topic;

/// Rates are given over at least this long: over less they say nothing.
const SHORTEST_WINDOW: Duration = Duration::from_millis(250);

/// Counts between two messages of `/diagnostics`, and the topics that somebody wants.
pub(crate) struct Telemetry {
    wanted: Vec<Topic>,
    /// Publishing ticks so far.
    pub(crate) ticks: u64,
    /// Energy when it was last changed from outside \[J\]: the drift is measured from it.
    pub(crate) energy_reference: f64,
    pub(crate) window: Window,
    /// Wall time that the latest wake-up left owed \[s\].
    owed: f64,
    /// Rates over the window before, for a message that comes early in the present one.
    pub(crate) last_rates: Rates,
}

/// Work since `began`.
pub(crate) struct Window {
    /// By the clock that simulation time goes by.
    began: Duration,
    steps: u64,
    /// Simulation time \[s\].
    simulated: f64,
    /// The wake-up that took longest since the last message.
    pub(crate) longest: WakeUp,
}

/// The steps of one wake-up.
#[derive(Clone, Copy, Default)]
pub(crate) struct WakeUp {
    steps: u64,
    took: Duration,
}

impl WakeUp {
    /// Time per step \[s\]; 0 where there was none.
    pub(crate) fn step_time(self) -> f64 {
        self.took.as_secs_f64() / in_f64(self.steps.max(1))
    }
}

#[derive(Clone, Copy, Default)]
pub(crate) struct Rates {
    pub(crate) real_time_factor: f64,
    pub(crate) steps_per_second: f64,
}

impl Telemetry {
    pub(crate) fn new<const N: usize>(now: Duration, simulation: &Simulation<N>) -> Self {
        Self {
            wanted: Vec::new(),
            ticks: 0,
            energy_reference: energy(simulation),
            window: Window::new(now),
            owed: 0.0,
            last_rates: Rates::default(),
        }
    }

    pub(crate) fn set_wanted(&mut self, topic: Topic, wanted: bool) {
        self.wanted.retain(|&one| one != topic);
        if wanted {
            self.wanted.push(topic);
        }
    }

    pub(crate) fn wants(&self, topic: Topic) -> bool {
        self.wanted.contains(&topic)
    }

    /// Notes the steps of a wake-up and the processor's time that it took.
    pub(crate) fn stepped(&mut self, steps: u64, took: Duration, timestep: f64) {
        if steps == 0 {
            return;
        }
        self.window.steps += steps;
        self.window.simulated += in_f64(steps) * timestep;
        if took > self.window.longest.took {
            self.window.longest = WakeUp { steps, took };
        }
    }

    /// Notes how many steps a wake-up left owed.
    pub(crate) fn note_backlog(&mut self, steps: u64, timestep: f64) {
        self.owed = in_f64(steps) * timestep;
    }

    /// Whether the arm lags so far behind wall time that it soon has to drop some, or does so already.
    pub(crate) fn lags(&self) -> bool {
        self.owed > CATCH_UP.as_secs_f64() / 2.0
    }
}

impl Window {
    pub(crate) fn new(now: Duration) -> Self {
        Self {
            began: now,
            steps: 0,
            simulated: 0.0,
            longest: WakeUp::default(),
        }
    }

    /// Rates since the window began; `None` while it is too short to tell.
    pub(crate) fn rates(&self, now: Duration) -> Option<Rates> {
        let elapsed = now.saturating_sub(self.began);
        (elapsed >= SHORTEST_WINDOW).then(|| Rates {
            real_time_factor: self.simulated / elapsed.as_secs_f64(),
            steps_per_second: in_f64(self.steps) / elapsed.as_secs_f64(),
        })
    }
}

/// Kinetic and potential energy of the arm \[J\].
pub(crate) fn energy<const N: usize>(simulation: &Simulation<N>) -> f64 {
    dynamics::energy(simulation.arm(), simulation.state())
}
