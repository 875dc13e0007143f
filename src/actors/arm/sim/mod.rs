//! The arm: steps the simulation against wall time, serves `/arm_sim/*` and `/pid_controller/*`, publishes its state.
//!
//! The actor (`node.rs`) only reads the clock and routes messages. The arm itself is in `live`, and its requests are in
//! `services`. `requests` handles clients' requests, `messages` has the messages of other nodes.
//!
//! **Invariant:** there is no physics here. The live arm and an offline `Simulation` are bit-identical.

mod messages;
mod node;
mod orders;
mod requests;
mod turn;
mod world;

pub use self::messages::{
    ArmPose, ArmSettings, AttachNodes, CommandEffort, CommandGoal, EndGoal, HeldLimit, SetListener,
    SetSetpoint, SimulationTime, TakeSnapshot, TrackGoal,
};
pub use self::node::ArmSim;
pub use self::orders::ArmOrder;
pub use self::requests::attach;
pub use self::turn::{TURN, TURN_MESSAGES};
pub use crate::live::{
    ArmEvent, ArmListener, GoalOrder, GoalProgress, LEAST_PAUSE, MoveSetpoint, Obstacle,
    PUBLISH_RATE, Pose, REST_TICKS, STEP_PAUSE, StepEvent, Tracking, WAKE_UP_BUDGET,
};
pub use crate::services::Echo;
pub use crate::services::arm::{
    Disturb, Enable, Integrator, MAX_STEPS, Pause, PeriodInForce, Push, Reset, STEPS_IN_A_ROW,
    SensorsInForce, SetFriction, SetGains, SetIntegrator, SetLimits, SetParams, SetPeriod,
    SetSensors, SetState, Step, Stepped, StepsEnd, joint_names,
};
pub use crate::services::study::Present;
