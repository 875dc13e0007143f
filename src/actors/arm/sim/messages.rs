//! Messages between the arm and other nodes or the runtime. Questions that clients can ask as well are
//! in `services`.
//!
//! **Invariant:** every message is plain: it knows nothing of the actor that handles it.

use actix::dev::{MessageResponse, OneshotSender};
use actix::prelude::*;
use glam::DVec2;

use crate::live::{GoalJudged, Pose, Tracking};
use crate::math::goal::Criteria;
use crate::math::simulation::Simulation;
use crate::services::study::Present;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

// ---- time and settings ----------------------------------------------------------------------------------------------

/// Asks for simulation time \[s\]. From `rosapi` and `rosout`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "f64")]
pub struct SimulationTime;

/// Asks for the simulation that an offline observer would have to run to get the present state. From tests.
#[derive(Message)]
#[rtype(result = "Snapshot<N>")]
pub struct TakeSnapshot<const N: usize>;

/// The whole simulation as it is now.
#[derive(MessageResponse)]
pub struct Snapshot<const N: usize>(pub Box<Simulation<N>>);

/// The arm's settings as they are now. From `study`, at every call.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Present<N>")]
pub struct ArmSettings<const N: usize>;

/// The largest stable control period and timestep \[s\] of a loop with held control. From the arm to `study`; none if
/// the runtime ends meanwhile.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<ClockLimits>")]
pub struct HeldLimit<const N: usize>(pub ControlLoop<N>);

/// The node to ask for [`HeldLimit`]. From the runtime, once; an arm that never hears it knows no limit.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Consult<const N: usize>(pub Recipient<HeldLimit<N>>);

// ---- goals ----------------------------------------------------------------------------------------------------------

/// Asks for the arm's pose now. From `ik` and `ik_trial`, at every request that depends on it, and from the republisher
/// of frames, whenever some are due.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Pose<N>")]
pub struct ArmPose<const N: usize>;

/// A goal begins, and the one before it ends, both in this instant. From `ik_action`, which then publishes the
/// trajectory and sends the [`CommandGoal`].
#[derive(Message)]
#[rtype(result = "Tracking<N>")]
pub struct TrackGoal<const N: usize> {
    /// Names the goal between `ik_action` and the arm; each is used once.
    pub number: u64,
    /// The target of the end effector \[m\].
    pub target: DVec2,
    /// When it counts as there.
    pub criteria: Criteria,
    /// Joint positions that put the end effector there \[rad\].
    pub solution: [f64; N],
    /// Hears of progress and of the end, unless that is the answer to its own message.
    pub owner: Recipient<GoalJudged<N>>,
}

/// A barrier in the mailbox of an owner of goals, which answers it when it has dealt with all that came before. From
/// the arm, before it says that it is at rest, and from `ik_trial`, which so hears all that the arm had said about
/// goals before it gave the time.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Barrier;

/// The sender tells clients of goals: the arm is to send it a [`Barrier`] before it says that it is at rest. From
/// `ik_action` and `joint_trajectory_controller`, when they start.
#[derive(Message, Debug, Clone)]
#[rtype(result = "()")]
pub struct AddBarrier(pub Recipient<Barrier>);

/// The goal's setpoint is held from the next step on, and the goal judged, unless it has ended. From `ik_action`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct CommandGoal<const N: usize> {
    /// The goal.
    pub number: u64,
    /// The setpoint \[rad\], at rest.
    pub positions: [f64; N],
}

/// The goal is preempted, unless it has ended already. From `ik_action`. The answer is how the latest goal ended.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<GoalJudged<N>>")]
pub struct EndGoal<const N: usize> {
    /// The goal.
    pub number: u64,
}

/// To the owner of the goal.
impl<const N: usize> Message for GoalJudged<N> {
    type Result = ();
}

/// Values of the arm that are answers.
macro_rules! answers {
    ($($answer:ident)*) => {
        $(impl<const N: usize, A: Actor, M: Message<Result = Self>> MessageResponse<A, M> for $answer<N> {
            fn handle(self, _: &mut A::Context, to: Option<OneshotSender<Self>>) {
                if let Some(to) = to {
                    // Nobody may be waiting any more.
                    let _ = to.send(self);
                }
            }
        })*
    };
}

answers! { Pose Present Tracking }
