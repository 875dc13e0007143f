//! A simulation as plain values, which can be stored outside the program and continued later.
//!
//! **Invariant:** a continued simulation takes the same steps, bit for bit, as the stored one would.

use super::hold::{Held, Hold, Memory};
use super::{Disturbance, Divergence, Simulation};
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::{Gains, Pid, Setpoint};
use crate::math::sensors::Sensors;

/// The whole state of a simulation between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checkpoint<const N: usize> {
    /// Lengths, masses and gravity.
    pub arm: Arm<N>,
    /// The controller's gains.
    pub gains: Gains<N>,
    /// The setpoint of the controller.
    pub setpoint: Setpoint<N>,
    /// Integral of the position error \[rad s\].
    pub integral: [f64; N],
    /// Whether the controller is on.
    pub enabled: bool,
    /// When the control law runs, and the held efforts.
    pub held: Held<N>,
    /// The limits of the motors, and the anti-windup.
    pub limits: Limits<N>,
    /// What the controller measures.
    pub sensors: Sensors<N>,
    /// What it has measured, and the efforts that wait.
    pub memory: Memory<N>,
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\], greater than 0.
    pub timestep: f64,
    /// Joint positions and velocities.
    pub state: State<N>,
    /// The rounding error of the state so far.
    pub carry: State<N>,
    /// Effort of the latest step \[N m\].
    pub effort: [f64; N],
    /// Effort \[N m\] that is added until this simulation time \[s\].
    pub disturbance: Option<([f64; N], f64)>,
    /// Simulation time at which this timestep was set \[s\].
    pub base: f64,
    /// Steps taken since then.
    pub steps_since_base: u64,
    /// Steps taken since the reset.
    pub steps: u64,
    /// Step and simulation time \[s\] of the first step whose result was not finite.
    pub divergence: Option<(u64, f64)>,
}

impl<const N: usize> Simulation<N> {
    /// The present state of the simulation.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint<N> {
        Checkpoint {
            arm: self.arm,
            gains: *self.pid.gains(),
            setpoint: *self.pid.setpoint(),
            integral: *self.pid.integral(),
            enabled: self.pid.is_enabled(),
            held: self.hold.held,
            limits: self.hold.limits,
            sensors: self.hold.sensors,
            memory: self.hold.memory(),
            method: self.method,
            timestep: self.timestep,
            state: self.state,
            carry: self.carry,
            effort: self.effort,
            disturbance: self.disturbance.map(|one| (one.effort, one.ends)),
            base: self.base,
            steps_since_base: self.steps_since_base,
            steps: self.steps,
            divergence: self.divergence.map(|one| (one.step, one.time)),
        }
    }

    /// The simulation of a checkpoint. Its timestep must be greater than 0, and its state finite.
    #[must_use]
    pub fn continued(from: &Checkpoint<N>) -> Self {
        let mut pid = Pid::new(from.gains);
        pid.enable(from.enabled);
        pid.set_setpoint(from.setpoint);
        pid.commit(from.integral);
        Self {
            arm: from.arm,
            pid,
            hold: Hold::new(
                from.held,
                from.limits,
                (from.sensors, from.memory),
                from.timestep,
            ),
            method: from.method,
            timestep: from.timestep,
            state: from.state,
            carry: from.carry,
            effort: from.effort,
            disturbance: from
                .disturbance
                .map(|(effort, ends)| Disturbance { effort, ends }),
            base: from.base,
            steps_since_base: from.steps_since_base,
            steps: from.steps,
            divergence: from
                .divergence
                .map(|(step, time)| Divergence { step, time }),
        }
    }
}
