//! Setpoints and efforts of clients, published on `/joint_trajectory` and `/effort_controller/commands`, and the
//! setpoint of the node that moves the arm along a path.
//!
//! **Invariant:** an input is accepted as a whole, or answered with a status that names the fault. A setpoint is moved
//! only if it is still the mover's last one. An effort acts only while the controller is off and its client is
//! connected.

use std::sync::Weak;

use actix::prelude::*;

use super::node::ArmSim;
use crate::actors::node::Done;
use crate::actors::wire::{Nodes, TopicMessage};
use crate::live::Obstacle;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Topic;
use crate::services::arm::{read_effort, read_setpoint};

/// Adds the topics to the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
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

impl<const N: usize> Handler<SetSetpoint<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, message: SetSetpoint<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.arm.hold(message.setpoint);
    }
}

/// Requests the arm's present motion. From `joint_trajectory_controller`, while a goal is active.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "JointMotion<N>")]
pub struct ArmMotion<const N: usize>;

/// The motion of the arm at one time.
#[derive(MessageResponse, Debug, Clone, Copy, PartialEq)]
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

impl<const N: usize> Handler<ArmMotion<N>> for ArmSim<N> {
    type Result = JointMotion<N>;

    fn handle(&mut self, _: ArmMotion<N>, ctx: &mut Context<Self>) -> JointMotion<N> {
        self.attend(ctx);
        JointMotion {
            state: *self.arm.simulation.state(),
            setpoint: *self.arm.simulation.pid().setpoint(),
            time: self.arm.simulation.time(),
            resets: self.arm.goals.past.resets,
            stands_still: self.arm.paused && self.arm.simulation.time() <= self.arm.paused_at,
            obstacle: Obstacle::of(&self.arm.simulation),
        }
    }
}

impl<const N: usize> Handler<MoveSetpoint<N>> for ArmSim<N> {
    type Result = bool;

    fn handle(&mut self, message: MoveSetpoint<N>, ctx: &mut Context<Self>) -> bool {
        self.attend(ctx);
        let is_known = *self.arm.simulation.pid().setpoint() == message.from;
        if is_known {
            self.arm.change(ArmInput::Setpoint(message.to));
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

impl<const N: usize> Handler<CommandEffort<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, command: CommandEffort<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let CommandEffort { effort, message } = command;
        match self.arm.command(effort) {
            Ok(()) => self.commander = Some(message.present),
            Err(why) => message.refuse(Topic::EffortCommands, &why),
        }
    }
}

impl<const N: usize> ArmSim<N> {
    /// Ends the command of a client that has disconnected.
    pub(super) fn end_orphaned_command(&mut self) {
        let is_gone = |present: &Weak<()>| present.strong_count() == 0;
        if self.commander.as_ref().is_some_and(is_gone) {
            self.commander = None;
            self.arm.change(ArmInput::Command([0.0; N]));
        }
    }
}
