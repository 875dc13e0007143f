//! The effects of other nodes' messages, and of setpoints and efforts of clients.
//!
//! **Invariant:** the arm advances to now before each order. An input of a client is accepted as a whole, or answered
//! with a status that names the fault. A setpoint is moved only if it is still the mover's last one. An effort acts
//! only while the controller is off and its client is connected.

use actix::prelude::*;

use super::messages::{
    ArmPose, CommandEffort, CommandGoal, EndGoal, SetListener, SetSetpoint, SimulationTime,
    TakeSnapshot, TrackGoal,
};
use super::node::ArmSim;
use crate::actors::node::{Nodes, TopicMessage};
use crate::live::{GoalProgress, Journal, MoveSetpoint, Pose, Tracking};
use crate::math::kinematics::Unreachable;
use crate::math::simulation::{ArmInput, Simulation};
use crate::protocol::catalog::Topic;
use crate::services::arm::read_effort;
use crate::services::trajectory::read_setpoint;

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
        self.take_due_steps(ctx);
        let answer = order.perform(self);
        self.end_rest(ctx);
        MessageResult(answer)
    }
}

impl<const N: usize> ArmOrder<N> for SimulationTime {
    fn perform(self, node: &mut ArmSim<N>) -> f64 {
        node.arm.simulation.time()
    }
}

impl<const N: usize> ArmOrder<N> for TakeSnapshot<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Box<Simulation<N>> {
        Box::new(node.arm.simulation.clone())
    }
}

impl<const N: usize> ArmOrder<N> for SetListener<N> {
    /// A listener gets the whole simulation first.
    fn perform(self, node: &mut ArmSim<N>) {
        let Self(listener) = self;
        node.arm.tell_state();
        node.arm.journal = listener.map(Journal::new);
        node.arm.tell_state();
    }
}

impl<const N: usize> ArmOrder<N> for ArmPose<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Pose<N> {
        node.arm.pose()
    }
}

impl<const N: usize> ArmOrder<N> for TrackGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Result<Tracking<N>, Unreachable> {
        node.arm.world.owner = Some(self.owner);
        node.arm.track_goal(&self.goal)
    }
}

impl<const N: usize> ArmOrder<N> for CommandGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        node.arm.command_goal(self.number, self.positions);
    }
}

impl<const N: usize> ArmOrder<N> for EndGoal<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Option<GoalProgress<N>> {
        node.arm.end_goal(self.number)
    }
}

impl<const N: usize> ArmOrder<N> for SetSetpoint<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        node.arm.hold(self.setpoint);
    }
}

impl<const N: usize> ArmOrder<N> for MoveSetpoint<N> {
    fn perform(self, node: &mut ArmSim<N>) -> Result<(), u64> {
        if *node.arm.simulation.pid().setpoint() != self.from {
            return Err(node.arm.pose().resets);
        }
        node.arm.change(ArmInput::Setpoint(self.to));
        Ok(())
    }
}

impl<const N: usize> ArmOrder<N> for CommandEffort<N> {
    fn perform(self, node: &mut ArmSim<N>) {
        let Self { effort, message } = self;
        match node.arm.command(effort) {
            Ok(()) => node.commander = Some(message.link),
            Err(why) => message.refuse(Topic::EffortCommands, &why),
        }
    }
}

/// Adds the topics to the registry's table.
pub(super) fn subscribe<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let hold = |setpoint, message: TopicMessage| SetSetpoint {
        setpoint,
        working: Some(message.working),
    };
    nodes.subscribe(Topic::JointTrajectory, arm.clone(), read_setpoint, hold);
    let command = |effort, message| CommandEffort { effort, message };
    nodes.subscribe(Topic::EffortCommands, arm.clone(), read_effort, command);
}
