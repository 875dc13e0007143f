//! Counts between two messages of `/diagnostics`, and the topics with subscribers.
//!
//! **Invariant:** all rates are over one window, which is long enough to measure them.

use std::time::Duration;

use crate::math::count::in_f64;
use crate::math::dynamics;
use crate::math::pacer::CATCH_UP;
use crate::math::simulation::Simulation;
use crate::protocol::catalog::Topic;

/// Shortest window for rates. Over a shorter one they are meaningless.
const SHORTEST_WINDOW: Duration = Duration::from_millis(250);

/// Counts between two messages of `/diagnostics`, and the topics with subscribers.
pub(crate) struct Counts {
    wanted: Vec<Topic>,
    /// Publishing ticks so far.
    pub(crate) ticks: u64,
    /// Energy after the last external change \[J\]. The drift is measured from it.
    pub(crate) energy_reference: f64,
    pub(crate) window: Window,
    /// Wall time by which the arm was late after the latest wake-up \[s\].
    pub(crate) behind: f64,
    /// Rates over the last window in which the arm moved, for a message early in the present one.
    pub(crate) last_rates: Rates,
}

/// Work since `began`.
pub(crate) struct Window {
    /// By the clock of the simulation time.
    began: Duration,
    steps: u64,
    /// Simulation time \[s\].
    simulated: f64,
    /// The longest wake-up since the last message.
    pub(crate) longest: WakeUp,
}

/// The steps of one wake-up.
#[derive(Clone, Copy, Default)]
pub(crate) struct WakeUp {
    steps: u64,
    took: Duration,
}

impl WakeUp {
    /// Time per step \[s\]; 0 without steps.
    pub(crate) fn step_time(self) -> f64 {
        self.took.as_secs_f64() / in_f64(self.steps.max(1))
    }
}

#[derive(Clone, Copy, Default)]
pub(crate) struct Rates {
    pub(crate) real_time_factor: f64,
    pub(crate) steps_per_second: f64,
}

impl Counts {
    pub(crate) fn new<const N: usize>(now: Duration, simulation: &Simulation<N>) -> Self {
        Self {
            wanted: Vec::new(),
            ticks: 0,
            energy_reference: energy(simulation),
            window: Window::new(now),
            behind: 0.0,
            last_rates: Rates::default(),
        }
    }

    pub(crate) fn set_wanted(&mut self, topic: Topic, wanted: bool) {
        self.wanted.retain(|&one| one != topic);
        if wanted {
            self.wanted.push(topic);
        }
    }

    pub(crate) const fn wants_any(&self) -> bool {
        !self.wanted.is_empty()
    }

    pub(crate) fn wants(&self, topic: Topic) -> bool {
        self.wanted.contains(&topic)
    }

    /// Records the steps of a wake-up and its processor time.
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

    /// Rates count from here, as after a pause.
    pub(crate) fn restart_window(&mut self, now: Duration) {
        let longest = self.window.longest;
        self.window = Window {
            longest,
            ..Window::new(now)
        };
    }

    /// Begins the next window. Keeps the rates of this one, unless the arm `stands`.
    pub(crate) fn end_window(&mut self, now: Duration, stands: bool) {
        if let Some(rates) = self.window.rates(now).filter(|_| !stands) {
            self.last_rates = rates;
        }
        self.window = Window::new(now);
    }

    /// Whether the arm is so late that it will soon drop steps, or drops them already.
    pub(crate) fn lags(&self) -> bool {
        self.behind > CATCH_UP.as_secs_f64() / 2.0
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

    /// Rates since the window began; `None` while the window is too short.
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
