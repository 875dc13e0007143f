//! Messages of other nodes and of the runtime to the arm, with their effects. Requests that clients can also send are in
//! `services`.
//!
//! **Invariant:** the arm advances to now before each [`ArmOrder`]. An input of a client is accepted as a whole, or
//! answered with a status that names the fault. A setpoint is moved only if it is still the mover's last one. An effort
//! acts only while the controller is off and its client is connected.

use actix::prelude::*;

use super::node::ArmSim;
use crate::actors::node::Done;
use crate::actors::wire::{Nodes, TopicMessage};
use crate::live::{ArmListener, GoalOrder, GoalProgress, Journal, Obstacle, Pose, Tracking};
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::math::simulation::{ArmInput, Simulation};
use crate::protocol::catalog::Topic;
use crate::services::arm::{read_effort, read_setpoint};
use crate::services::study::Present;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

/// A message that needs the arm's present state, or changes it.
pub trait ArmOrder<const N: usize>: Message {
    /// Its effect, and the answer.
    fn perform(self, node: &mut ArmSim<N>) -> Self::Result;
}

impl<const N: usize, M: ArmOrder<N>> Handler<M> for ArmSim<N>
where
    M::Result: 'static,
{
    type Result = MessageResult<M>;

    fn handle(&mut self, order: M, ctx: &mut Context<Self>) -> MessageResult<M> {
        self.attend(ctx);
        MessageResult(order.perform(self))
    }
}

// ---- time and settings ----------------------------------------------------------------------------------------------

/// Requests simulation time \[s\]. From `rosapi` and `rosout`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "f64")]
pub struct SimulationTime;

impl<const N: usize> ArmOrder<N> for SimulationTime {
    fn perform(self, node: &mut ArmSim<N>) -> f64 {
        node.arm.simulation.time()
    }
}

/// Requests the offline simulation with the same state. From tests.
#[derive(Message)]
#[rtype(result = "Snapshot<N>")]
pub struct TakeSnapshot<const N: usize>;

/// The whole present simulation.
pub struct Snapshot<const N: usize>(pub Box<Simulation<N>>);

impl<const N: usize> ArmOrder<N> for TakeSnapshot<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Snapshot<N> {
        Snapshot(Box::new(node.arm.simulation.clone()))
    }
}

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

impl<const N: usize> ArmOrder<N> for Tell<N> {
    /// A listener gets the whole simulation first.
    fn perform(self, node: &mut ArmSim<N>) {
        let Self(listener) = self;
        node.arm.tell_state();
        node.arm.journal = listener.map(Journal::new);
        node.arm.tell_state();
    }
}

// ---- goals ----------------------------------------------------------------------------------------------------------

/// Requests the arm's present pose. From `ik` and `ik_trial` at every request that depends on it, and from the
/// republisher of frames when frames are due.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Pose<N>")]
pub struct ArmPose<const N: usize>;

impl<const N: usize> ArmOrder<N> for ArmPose<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Pose<N> {
        node.arm.pose()
    }
}

/// Begins a goal and ends the previous one, at the same time. From `ik_action`, which then publishes the
/// trajectory and sends the [`CommandGoal`].
#[derive(Message)]
#[rtype(result = "Tracking<N>")]
pub struct TrackGoal<const N: usize> {
    /// The goal.
    pub goal: GoalOrder<N>,
    /// The receiver of feedback and of the end, unless the end is the answer to its own message.
    pub owner: Recipient<GoalProgress<N>>,
}

impl<const N: usize> ArmOrder<N> for TrackGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Tracking<N> {
        node.arm.world.owner = Some(self.owner);
        node.arm.track_goal(&self.goal)
    }
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

impl<const N: usize> ArmOrder<N> for CommandGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        node.arm.command_goal(self.number, self.positions);
    }
}

/// Preempts the goal, unless it has ended already. From `ik_action`. The answer is how the latest goal ended.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "Option<GoalProgress<N>>")]
pub struct EndGoal<const N: usize> {
    /// The goal.
    pub number: u64,
}

impl<const N: usize> ArmOrder<N> for EndGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Option<GoalProgress<N>> {
        node.arm.end_goal(self.number)
    }
}

/// To the owner of the goal.
impl<const N: usize> Message for GoalProgress<N> {
    type Result = ();
}

// ---- setpoints and efforts ------------------------------------------------------------------------------------------

/// Adds the topics to the registry's table.
pub(super) fn listen<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let node = arm.clone();
    let hold = move |message: TopicMessage| match read_setpoint(&message.msg) {
        Ok(setpoint) => node.do_send(SetSetpoint {
            setpoint,
            done: Some(message.done),
        }),
        Err(why) => message.refuse(Topic::JointTrajectory, &why),
    };
    nodes.listen(Topic::JointTrajectory, hold);
    let node = arm.clone();
    let command = move |message: TopicMessage| match read_effort(&message.msg) {
        Ok(effort) => node.do_send(CommandEffort { effort, message }),
        Err(why) => message.refuse(Topic::EffortCommands, &why),
    };
    nodes.listen(Topic::EffortCommands, command);
}

/// A setpoint for the controller, from the next step on. From clients, by `/joint_trajectory`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetSetpoint<const N: usize> {
    /// The joint state to hold.
    pub setpoint: Setpoint<N>,
    /// Dropped when it has taken effect.
    pub done: Option<Done>,
}

impl<const N: usize> ArmOrder<N> for SetSetpoint<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        node.arm.hold(self.setpoint);
    }
}

/// Requests the arm's present motion. From `joint_trajectory_controller`, while a goal is active.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "JointMotion<N>")]
pub struct ArmMotion<const N: usize>;

/// The motion of the arm at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion<const N: usize> {
    /// Positions and velocities.
    pub state: State<N>,
    /// The held joint state.
    pub setpoint: Setpoint<N>,
    /// Simulation time since the last reset \[s\].
    pub time: f64,
    /// The number of resets.
    pub resets: u64,
    /// Whether it is paused and no step has been taken since.
    pub stands_still: bool,
    /// Why it does not follow its setpoint; `None` if it does.
    pub obstacle: Option<Obstacle>,
}

/// Moves the setpoint, if it is still the sender's last one. The answer is whether it was. From
/// `joint_trajectory_controller`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "bool")]
pub struct MoveSetpoint<const N: usize> {
    /// The sender's last setpoint.
    pub from: Setpoint<N>,
    /// The next one.
    pub to: Setpoint<N>,
}

impl<const N: usize> ArmOrder<N> for ArmMotion<N> {
    fn perform(self, node: &mut ArmSim<N>) -> JointMotion<N> {
        let (arm, simulation) = (&node.arm, &node.arm.simulation);
        JointMotion {
            state: *simulation.state(),
            setpoint: *simulation.pid().setpoint(),
            time: simulation.time(),
            resets: arm.goals.past.resets,
            stands_still: arm.paused && simulation.time() <= arm.paused_at,
            obstacle: Obstacle::of(simulation),
        }
    }
}

impl<const N: usize> ArmOrder<N> for MoveSetpoint<N> {
    fn perform(self, node: &mut ArmSim<N>) -> bool {
        let is_known = *node.arm.simulation.pid().setpoint() == self.from;
        if is_known {
            node.arm.change(ArmInput::Setpoint(self.to));
        }
        is_known
    }
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

impl<const N: usize> ArmOrder<N> for CommandEffort<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        let Self { effort, message } = self;
        match node.arm.command(effort) {
            Ok(()) => node.commander = Some(message.present),
            Err(why) => message.refuse(Topic::EffortCommands, &why),
        }
    }
}
