//! A control loop: the arm, its gains and setpoint, and how it is stepped.
//!
//! Predictions, offline runs and measurements all use this type. They step it through [`ControlLoop::simulation`], the
//! live arm's own stepper.
//!
//! **Invariant:** gains that are all zero and a controller that is off are the same loop.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::Sensors;
use crate::math::simulation::{ControlPeriod, DEFAULT_TIMESTEP, Simulation};
use crate::math::simulation::{Held, Hold, Memory};

/// An arm with its control law, method, timestep and control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLoop<const N: usize> {
    /// The arm.
    pub arm: Arm<N>,
    /// Gains of the controller; if all are zero, the arm is free.
    pub gains: Gains<N>,
    /// The setpoint at which the controller holds it.
    pub setpoint: Setpoint<N>,
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\].
    pub timestep: f64,
    /// When the law runs.
    pub period: ControlPeriod,
    /// The limits of the motors, and the anti-windup. Predictions near an equilibrium hold while no effort is at its
    /// limit.
    pub limits: Limits<N>,
    /// What the controller measures. Predictions are without the steps of encoders.
    pub sensors: Sensors<N>,
}

impl<const N: usize> ControlLoop<N> {
    /// The loop, stepped by Runge-Kutta 4 at [`DEFAULT_TIMESTEP`].
    pub fn new(arm: Arm<N>, gains: Gains<N>, setpoint: Setpoint<N>) -> Self {
        Self {
            arm,
            gains,
            setpoint,
            method: Method::Rk4,
            timestep: DEFAULT_TIMESTEP,
            period: ControlPeriod::default(),
            limits: Limits::default(),
            sensors: Sensors::default(),
        }
    }

    /// The given control period \[s\]; zero if the law runs in every step, and without a law.
    pub fn given_period(&self) -> f64 {
        if self.is_free() {
            0.0
        } else {
            self.period.period
        }
    }

    /// A free arm.
    pub fn free(arm: Arm<N>) -> Self {
        Self::new(arm, no_control(), Setpoint::default())
    }

    /// The loop of a simulation with its gains, even if the controller is off.
    pub fn of(simulation: &Simulation<N>) -> Self {
        let pid = simulation.pid();
        Self {
            arm: *simulation.arm(),
            gains: *pid.gains(),
            setpoint: *pid.setpoint(),
            method: simulation.method(),
            timestep: simulation.timestep(),
            period: simulation.control_period(),
            limits: *simulation.limits(),
            sensors: *simulation.sensors(),
        }
    }

    /// The loop that is active in the next step of a simulation.
    pub fn in_force(simulation: &Simulation<N>) -> Self {
        let set = Self::of(simulation);
        if simulation.pid().is_enabled() {
            set
        } else {
            Self {
                gains: no_control(),
                setpoint: Setpoint::default(),
                ..set
            }
        }
    }

    /// The same loop with another method.
    #[must_use]
    pub const fn with_method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// The same loop with another timestep \[s\].
    #[must_use]
    pub const fn with_timestep(self, timestep: f64) -> Self {
        Self { timestep, ..self }
    }

    /// The same loop with another control period.
    #[must_use]
    pub const fn with_period(self, period: ControlPeriod) -> Self {
        Self { period, ..self }
    }

    /// Whether all gains are zero. The controller then has no effect even if it is enabled.
    #[must_use]
    pub fn is_free(&self) -> bool {
        let Gains { kp, ki, kd } = &self.gains;
        kp.iter().chain(ki).chain(kd).all(|&gain| gain <= 0.0)
    }

    /// The joints that have an integral gain.
    pub fn integrating(&self) -> [bool; N] {
        self.gains.ki.map(|ki| ki > 0.0)
    }

    /// The live simulation in the state `start`, with an integral of zero.
    pub fn simulation(&self, start: State<N>) -> Simulation<N> {
        let mut simulation = Simulation::new(self.arm, self.gains);
        simulation.set_method(self.method);
        simulation.set_timestep(self.timestep);
        simulation.set_control_period(self.period);
        simulation.set_limits(self.limits);
        simulation.set_sensors(self.sensors);
        simulation.set_state(start);
        simulation.set_setpoint(self.setpoint);
        simulation.enable(!self.is_free());
        simulation
    }
}

impl<const N: usize> ControlLoop<N> {
    /// What the loop holds between two runs of its law, at the start.
    pub(super) fn hold(&self) -> Hold<N> {
        let held = Held {
            period: self.period,
            ..Held::default()
        };
        let sensors = (self.sensors, Memory::default());
        Hold::new(held, self.limits, sensors, self.timestep)
    }
}

/// Gains that are all zero: a free arm.
pub const fn no_control<const N: usize>() -> Gains<N> {
    Gains {
        kp: [0.0; N],
        ki: [0.0; N],
        kd: [0.0; N],
    }
}
