//! Efforts of clients, published on `/effort_controller/commands`.
//!
//! **Invariant:** a command acts only while the controller is off and its client is connected.

use std::sync::Weak;

use actix::prelude::*;

use super::node::ArmSim;
use crate::actors::wire::{Nodes, TopicMessage};
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Topic;
use crate::services::arm::read_effort;

/// Adds this file's topic to the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let arm: Recipient<CommandEffort<N>> = arm.clone().recipient();
    let take = move |message: TopicMessage| match read_effort(&message.msg) {
        Ok(effort) => arm.do_send(CommandEffort { effort, message }),
        Err(why) => message.refuse(Topic::EffortCommands, &why),
    };
    nodes.listen(Topic::EffortCommands, take);
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
