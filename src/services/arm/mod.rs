//! The requests to the arm: `/arm_sim/*` and `/pid_controller/*`, setpoints, efforts and parameters.
//!
//! A request has the valid fields, and the rejected ones by name. Valid fields take effect, and the answer echoes the
//! present values.
//!
//! **Invariant:** an invalid field never prevents a valid one from taking effect.

mod disturb;
mod friction;
mod gains;
mod integrator;
mod limits;
mod messages;
mod parameters;
mod period;
mod reset;
mod sensors;
mod set_params;
mod state;
mod step;
mod switches;
mod time;

pub(crate) use self::disturb::DIVERGED;
pub use self::disturb::{Disturb, Push};
pub use self::friction::SetFriction;
pub use self::gains::SetGains;
pub use self::integrator::{Integrator, SetIntegrator};
pub use self::limits::SetLimits;
pub use self::messages::{joint_names, read_effort};
pub use self::parameters::{
    AskParameters, NamedParameter, NotSet, ParameterChange, ParameterRequest, ParameterValue,
    parameter_services,
};
pub use self::period::{PeriodInForce, SetPeriod};
pub use self::reset::Reset;
pub use self::sensors::{SensorsInForce, SetSensors};
pub use self::set_params::SetParams;
pub use self::state::SetState;
pub use self::step::{MAX_STEPS, STEPS_IN_A_ROW, Step, Stepped, StepsEnd};
pub use self::switches::{Enable, Pause};
pub use self::time::GetTime;
