//! Efforts of clients, which they publish on `/effort_controller/commands`.
//!
//! **Invariant:** a command is in force while the controller is off and its client is connected, and no longer.

use std::sync::Weak;

use actix::prelude::*;

use crate::actors::arm::sim::node::ArmSim;
use crate::actors::wire::{Nodes, Route, TopicMessage};
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Has the registry bring this file's commands.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let commands = commands(arm.clone().recipient());
    nodes.listeners.insert(Topic::EffortCommands, commands);
}

/// An effort to be applied from the next step on. From clients, by `/effort_controller/commands`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CommandEffort<const N: usize> {
    /// Effort per joint \[N m\].
    pub effort: [f64; N],
    /// The message that it came in: its client is told if the controller is on.
    pub message: TopicMessage,
}

impl<const N: usize> Handler<CommandEffort<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, command: CommandEffort<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        let CommandEffort { effort, message } = command;
        if self.simulation.pid().is_enabled() {
            let off = Service::Enable.name();
            let why = format!("the controller is on; {off} with data false switches it off");
            return message.refuse(Topic::EffortCommands, &why);
        }
        self.commander = Some(message.present);
        self.change(ArmInput::Command(effort));
    }
}

impl<const N: usize> ArmSim<N> {
    /// Ends the command of a client that has gone.
    pub(in crate::actors::arm::sim) fn end_orphaned_command(&mut self) {
        let is_gone = |present: &Weak<()>| present.strong_count() == 0;
        if self.commander.as_ref().is_some_and(is_gone) {
            self.commander = None;
            self.change(ArmInput::Command([0.0; N]));
        }
    }
}

/// Commands on their way to the arm; an error status for what is none.
fn commands<const N: usize>(arm: Recipient<CommandEffort<N>>) -> Route<TopicMessage> {
    Box::new(move |message| match read_command(&message) {
        Ok(effort) => arm.do_send(CommandEffort { effort, message }),
        Err(why) => message.refuse(Topic::EffortCommands, &why),
    })
}

/// `std_msgs/msg/Float64MultiArray`: its layout says nothing that counts.
fn read_command<const N: usize>(message: &TopicMessage) -> Result<[f64; N], Rejections> {
    let args = Arguments::Object(message.heard.msg.clone());
    let mut fields = Fields::of_message(&args, Topic::EffortCommands)?;
    let effort = fields.array("data", Bound::Finite);
    effort.ok_or_else(|| fields.finish())
}
