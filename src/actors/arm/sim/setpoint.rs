//! Setpoints of clients, published on `/joint_trajectory`.
//!
//! **Invariant:** a setpoint is accepted as a whole, or answered with a status that names the fault.

use actix::prelude::*;

use super::node::ArmSim;
use crate::actors::node::Done;
use crate::actors::wire::{Nodes, TopicMessage};
use crate::math::pid::Setpoint;
use crate::protocol::catalog::Topic;
use crate::services::arm::read_setpoint;

/// Adds this file's topic to the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let arm: Recipient<SetSetpoint<N>> = arm.clone().recipient();
    let take = move |message: TopicMessage| match read_setpoint(&message.msg) {
        Ok(setpoint) => arm.do_send(SetSetpoint {
            setpoint,
            done: Some(message.done),
        }),
        Err(why) => message.refuse(Topic::JointTrajectory, &why),
    };
    nodes.listen(Topic::JointTrajectory, take);
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
