//! The recorded arm's settings, from when on they held.
//!
//! **Invariant:** they are those that the inputs of the record have led to.

use crate::actors::arm::sim::Integrator;
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::math::simulation::Simulation;
use crate::record::{Note, read_note};

/// The settings that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RecordedSettings<const N: usize> {
    pub(super) arm: Arm<N>,
    pub(super) gains: Gains<N>,
    pub(super) integrator: Integrator,
    pub(super) is_enabled: bool,
}

/// Follows the inputs to the arm, in their order.
pub(super) struct SettingsHistory<const N: usize> {
    simulation: Option<Simulation<N>>,
    settings: Vec<(u64, RecordedSettings<N>)>,
}

impl<const N: usize> SettingsHistory<N> {
    pub(super) const fn new() -> Self {
        Self {
            simulation: None,
            settings: Vec::new(),
        }
    }

    /// Takes an input; one that can't be read changes nothing.
    pub(super) fn take(&mut self, time: u64, note: &str) {
        match read_note(note) {
            Ok(Note::Begin(checkpoint)) => {
                self.simulation = Some(Simulation::continued(&checkpoint));
            }
            Ok(Note::Input(input)) => {
                if let Some(simulation) = &mut self.simulation {
                    simulation.apply(input);
                }
            }
            Ok(Note::Diverged) => {}
            Err(error) => tracing::warn!(%error, "an input of the record is left out"),
        }
        let Some(simulation) = &self.simulation else {
            return;
        };
        let settings = RecordedSettings {
            arm: *simulation.arm(),
            gains: *simulation.pid().gains(),
            integrator: Integrator {
                method: simulation.method(),
                timestep: simulation.timestep(),
            },
            is_enabled: simulation.pid().is_enabled(),
        };
        let last = self.settings.last();
        if last.is_none_or(|(_, last)| *last != settings) {
            self.settings.push((time, settings));
        }
    }

    /// The settings, each with the time from which on they hold.
    pub(super) fn settings(self) -> Vec<(u64, RecordedSettings<N>)> {
        self.settings
    }
}
