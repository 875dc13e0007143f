//! The requests to the arm: `/arm_sim/*` and `/pid_controller/*`, setpoints, efforts and parameters.
//!
//! A request has the valid fields, and the rejected ones by name. Valid fields take effect, and the answer echoes the
//! present values.
//!
//! **Invariant:** an invalid field never prevents a valid one from taking effect.

mod controller;
mod parameters;
mod simulation;

pub use self::controller::{
    Enable, PeriodInForce, SensorsInForce, SetGains, SetLimits, SetPeriod, SetSensors,
};
pub use self::parameters::{
    AskParameters, NamedParameter, NotSet, ParameterChange, ParameterRequest, ParameterValue,
    parameter_services,
};
pub(crate) use self::simulation::DIVERGED;
pub use self::simulation::{
    Disturb, GetTime, Integrator, MAX_STEPS, Pause, Push, Reset, STEPS_IN_A_ROW, SetFriction,
    SetIntegrator, SetParams, SetState, Step, Stepped, StepsEnd, joint_names, read_effort,
};
