//! Messages of other nodes and of the runtime to the arm. Requests that clients can also send are in `services`.
//!
//! **Invariant:** every message is a plain value, independent of the actor that handles it.

use actix::prelude::*;

use crate::actors::node::{Barrier, TopicMessage, Working};
use crate::live::{ArmListener, GoalOrder, GoalProgress, MoveSetpoint, Pose, Tracking};
use crate::math::kinematics::Unreachable;
use crate::math::pid::Setpoint;
use crate::math::simulation::Simulation;
use crate::services::study::Present;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

// ---- time and settings ----------------------------------------------------------------------------------------------

/// Requests simulation time \[s\]. From `rosout`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "f64")]
pub struct SimulationTime;

/// Requests the offline simulation with the same state. From tests.
#[derive(Message)]
#[rtype(result = "Box<Simulation<N>>")]
pub struct TakeSnapshot<const N: usize>;

/// The arm's present settings. From `study`, at every call.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Present<N>")]
pub struct ArmSettings<const N: usize>;

/// The largest stable control period and timestep \[s\] of a loop with held control. From the arm to `study`. `None`
/// if the runtime ends meanwhile.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<ClockLimits>")]
pub struct HeldLimit<const N: usize>(pub ControlLoop<N>);

/// The nodes around the arm. From the runtime, once.
#[derive(Message)]
#[rtype(result = "()")]
pub struct AttachNodes<const N: usize> {
    /// The node that computes [`HeldLimit`]. Without it an arm has no limits.
    pub study: Option<Recipient<HeldLimit<N>>>,
    /// The actors that inform clients of goals: the registry, `ik_action` and `joint_trajectory_controller`. The arm
    /// sends them a [`Barrier`] before it reports that it is at rest, and between steps on request.
    pub goal_reporters: Vec<Recipient<Barrier>>,
}

/// Sets the listener of the journal, or none. From the recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetListener<const N: usize>(pub Option<ArmListener<N>>);

// ---- goals ----------------------------------------------------------------------------------------------------------

/// Requests the arm's present pose. From `ik_trial` at every request that depends on it, from
/// `joint_trajectory_controller` while a goal is active, and from the republisher of frames when frames are due.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Pose<N>")]
pub struct ArmPose<const N: usize>;

/// Solves a goal, begins it and ends the previous one, at the same time. From `ik_action`, which then publishes the
/// trajectory and sends the [`CommandGoal`].
#[derive(Message)]
#[rtype(result = "Result<Tracking<N>, Unreachable>")]
pub struct TrackGoal<const N: usize> {
    /// The goal.
    pub goal: GoalOrder,
    /// The receiver of feedback and of the end, unless the end is the answer to its own message.
    pub owner: Recipient<GoalProgress<N>>,
}

/// Holds the goal's setpoint from the next step on, and checks the goal, unless it has ended. From `ik_action`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct CommandGoal<const N: usize> {
    /// The goal.
    pub number: u64,
    /// The setpoint \[rad\], at rest.
    pub positions: [f64; N],
}

/// Preempts the goal, unless it has ended already. From `ik_action`. The answer is how the latest goal ended.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<GoalProgress<N>>")]
pub struct EndGoal<const N: usize> {
    /// The goal.
    pub number: u64,
}

/// To the owner of the goal.
impl<const N: usize> Message for GoalProgress<N> {
    type Result = ();
}

// ---- setpoints and efforts ------------------------------------------------------------------------------------------

/// A setpoint for the controller, from the next step on. From clients, by `/joint_trajectory`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetSetpoint<const N: usize> {
    /// The joint state to hold.
    pub setpoint: Setpoint<N>,
    /// Dropped when it has taken effect.
    pub working: Option<Working>,
}

/// From `joint_trajectory_controller`.
impl<const N: usize> Message for MoveSetpoint<N> {
    type Result = Result<(), u64>;
}

/// An effort to be applied from the next step on. From clients, by `/effort_controller/commands`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CommandEffort<const N: usize> {
    /// Effort per joint \[N m\].
    pub effort: [f64; N],
    /// The client's message. Its client gets an error if the controller is on.
    pub message: TopicMessage,
}
