//! Messages between the arm and other nodes or the runtime. Requests that clients can also send are in `services`.
//!
//! **Invariant:** every message is a plain value, independent of the actor that handles it.

use actix::dev::{MessageResponse, OneshotSender};
use actix::prelude::*;
use glam::DVec2;

use crate::live::{ArmListener, GoalProgress, Pose, Tracking};
use crate::math::goal::Criteria;
use crate::math::simulation::Simulation;
use crate::services::study::Present;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

// ---- time and settings ----------------------------------------------------------------------------------------------

/// Requests simulation time \[s\]. From `rosapi` and `rosout`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "f64")]
pub struct SimulationTime;

/// Requests the offline simulation with the same state. From tests.
#[derive(Message)]
#[rtype(result = "Snapshot<N>")]
pub struct TakeSnapshot<const N: usize>;

/// The whole present simulation.
#[derive(MessageResponse)]
pub struct Snapshot<const N: usize>(pub Box<Simulation<N>>);

/// The arm's present settings. From `study`, at every call.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Present<N>")]
pub struct ArmSettings<const N: usize>;

/// The largest stable control period and timestep \[s\] of a loop with held control. From the arm to `study`. `None`
/// if the runtime ends meanwhile.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<ClockLimits>")]
pub struct HeldLimit<const N: usize>(pub ControlLoop<N>);

/// The node that computes [`HeldLimit`]. From the runtime, once. Without it an arm has no limits.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Consult<const N: usize>(pub Recipient<HeldLimit<N>>);

/// Sets the listener of the journal, or none. From the recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Tell<const N: usize>(pub Option<ArmListener<N>>);

// ---- goals ----------------------------------------------------------------------------------------------------------

/// Requests the arm's present pose. From `ik` and `ik_trial` at every request that depends on it, and from the
/// republisher of frames when frames are due.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Pose<N>")]
pub struct ArmPose<const N: usize>;

/// Begins a goal and ends the previous one, at the same time. From `ik_action`, which then publishes the
/// trajectory and sends the [`CommandGoal`].
#[derive(Message)]
#[rtype(result = "Tracking<N>")]
pub struct TrackGoal<const N: usize> {
    /// Identifies the goal between `ik_action` and the arm. Each id is used once.
    pub number: u64,
    /// The target of the end effector \[m\].
    pub target: DVec2,
    /// The condition for success.
    pub criteria: Criteria,
    /// Joint positions that put the end effector there \[rad\].
    pub solution: [f64; N],
    /// The receiver of feedback and of the end, unless the end is the answer to its own message.
    pub owner: Recipient<GoalProgress<N>>,
}

/// A barrier in the mailbox of an owner of goals, which answers it after all earlier messages. From the arm, before it
/// reports that it is at rest. Also from `ik_trial`, which so gets all news of goals that the arm sent before the time.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Barrier;

/// The sender informs clients of goals, so the arm sends it a [`Barrier`] before it reports that it is at rest.
/// From `ik_action` and `joint_trajectory_controller`, when they start.
#[derive(Message, Debug, Clone)]
#[rtype(result = "()")]
pub struct AddBarrier(pub Recipient<Barrier>);

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

/// Values of the arm that are answers.
macro_rules! answers {
    ($($answer:ident)*) => {
        $(impl<const N: usize, A: Actor, M: Message<Result = Self>> MessageResponse<A, M> for $answer<N> {
            fn handle(self, _: &mut A::Context, to: Option<OneshotSender<Self>>) {
                if let Some(to) = to {
                    // The receiver may have ended.
                    let _ = to.send(self);
                }
            }
        })*
    };
}

answers! { Pose Present Tracking }
