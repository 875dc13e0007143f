//! The external inputs of the steps: one variant per kind of change.
//!
//! **Invariant:** a simulation with the same inputs before the same steps takes the same steps, bit for bit.

use super::{Checkpoint, ControlPeriod, Simulation};
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::Sensors;

/// An external change, effective from the next step on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArmInput<const N: usize> {
    /// The method that takes the steps.
    Method(Method),
    /// Length of a step \[s\], greater than 0.
    Timestep(f64),
    /// Lengths, masses and gravity.
    Arm(Arm<N>),
    /// The controller's gains.
    Gains(Gains<N>),
    /// The controller on or off.
    Enabled(bool),
    /// The setpoint of the controller.
    Setpoint(Setpoint<N>),
    /// An effort that is added for some time.
    Disturbance {
        /// \[N m\].
        effort: [f64; N],
        /// Simulation time \[s\], greater than 0.
        duration: f64,
    },
    /// The control period.
    Period(ControlPeriod),
    /// The limits of the motors, and the anti-windup.
    Limits(Limits<N>),
    /// What the controller measures.
    Sensors(Sensors<N>),
    /// Positions and velocities of the joints.
    State(State<N>),
    /// An effort that is applied while the controller is off \[N m\].
    Command([f64; N]),
    /// An effort \[N m\] that replaces all others except a disturbance; `None` ends it.
    Drive(Option<[f64; N]>),
    /// Returns the arm to the starting pose.
    Reset,
}

/// An entry of the journal of a simulation's steps.
#[derive(Debug, Clone, PartialEq)]
pub enum StepNote<const N: usize> {
    /// The whole simulation, at the start of the journal and after a gap.
    Begin(Box<Checkpoint<N>>),
    /// An external change.
    Input(ArmInput<N>),
    /// The next step was not finite and was not taken.
    Diverged,
}

impl<const N: usize> Simulation<N> {
    /// Applies `input`.
    pub fn apply(&mut self, input: ArmInput<N>) {
        match input {
            ArmInput::Method(method) => self.set_method(method),
            ArmInput::Timestep(timestep) => {
                self.set_timestep(timestep);
            }
            ArmInput::Arm(arm) => self.set_arm(arm),
            ArmInput::Gains(gains) => self.set_gains(gains),
            ArmInput::Enabled(on) => self.enable(on),
            ArmInput::Setpoint(setpoint) => self.set_setpoint(setpoint),
            ArmInput::Disturbance { effort, duration } => self.disturb(effort, duration),
            ArmInput::Period(period) => self.set_control_period(period),
            ArmInput::Limits(limits) => self.set_limits(limits),
            ArmInput::Sensors(sensors) => self.set_sensors(sensors),
            ArmInput::State(state) => self.set_state(state),
            ArmInput::Command(effort) => self.set_command(effort),
            ArmInput::Drive(effort) => self.drive(effort),
            ArmInput::Reset => self.reset(),
        }
    }
}
