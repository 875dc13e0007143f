//! The arm: steps the simulation against wall time, serves `/arm_sim/*` and `/pid_controller/*`, publishes its state.
//!
//! The actor (`node.rs`) only asks the clock and says who hears what. What is due is computed by `math::pacer`, what
//! happens in a step by `math::simulation`. `services` has what clients can ask, `messages` what other nodes say;
//! `telemetry` and `scene` publish, `goals` judges goals and `limit` timesteps, with what the arm remembers for them in
//! `state`.
//!
//! **Invariant:** nothing here decides physics; the live arm does what `Simulation` does offline, bit for bit.

mod goals;
mod limit;
mod messages;
mod motion;
mod node;
mod scene;
mod services;
mod state;
mod telemetry;
mod tell;

pub use self::limit::LEAST_PAUSE;
pub use self::messages::{
    AddBarrier, ArmPose, ArmSettings, Barrier, CommandGoal, Consult, EndGoal, GoalJudged,
    HeldLimit, Obstacle, Pose, Present, SimulationTime, Snapshot, TakeSnapshot, TrackGoal,
    Tracking,
};
pub use self::motion::{ArmMotion, JointMotion, MoveSetpoint};
pub use self::node::{ArmSim, BREATHER, PUBLISH_RATE, WAKE_UP_BUDGET, joint_names};
pub use self::services::command::CommandEffort;
pub use self::services::disturb::{Disturb, Push};
pub use self::services::field_by_field::{Echo, FieldByField};
pub use self::services::gains::SetGains;
pub use self::services::integrator::{Integrator, SetIntegrator};
pub use self::services::params::SetParams;
pub use self::services::period::{PeriodInForce, SetPeriod};
pub use self::services::reset::Reset;
pub use self::services::setpoint::SetSetpoint;
pub use self::services::state::SetState;
pub use self::services::step::{MAX_STEPS, STEPS_IN_A_ROW, Step};
pub use self::services::switches::{Enable, Pause};
pub use self::state::journal::{ArmEvent, ArmListener, ArmNews, Tell};
pub use self::state::steps::{Stepped, StepsEnd};
pub use self::state::turn::{TURN, TURN_MESSAGES};
