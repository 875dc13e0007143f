//! Setpoints, which clients publish on `/joint_trajectory`.
//!
//! **Invariant:** a setpoint is taken as a whole, or answered with a status that says what is wrong with it.

use actix::prelude::*;

use crate::actors::arm::sim::node::{ArmSim, joint_names};
use crate::actors::node::Done;
use crate::actors::wire::{Nodes, Route, TopicMessage};
use crate::math::pid::Setpoint;
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::trajectory::TrajectoryError;

/// Has the registry bring this file's setpoints.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    let setpoints = setpoints(arm.clone().recipient());
    nodes.listeners.insert(Topic::JointTrajectory, setpoints);
}

/// A setpoint for the controller, from the next step on. From clients, by `/joint_trajectory`.
#[derive(Message)]
#[rtype(result = "()")]
pub struct SetSetpoint<const N: usize> {
    /// The joint state to be held.
    pub setpoint: Setpoint<N>,
    /// Dropped when it is held.
    pub done: Option<Done>,
}

impl<const N: usize> Handler<SetSetpoint<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, message: SetSetpoint<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.change(ArmInput::Setpoint(message.setpoint));
        self.goals.setpoint_waits = !self.simulation.pid().is_enabled();
    }
}

/// Setpoints on their way to the arm; an error status for what is none.
fn setpoints<const N: usize>(arm: Recipient<SetSetpoint<N>>) -> Route<TopicMessage> {
    Box::new(move |message| match read_setpoint(&message) {
        Ok(setpoint) => arm.do_send(SetSetpoint {
            setpoint,
            done: Some(message.done),
        }),
        Err(why) => message.refuse(Topic::JointTrajectory, &why),
    })
}

fn read_setpoint<const N: usize>(message: &TopicMessage) -> Result<Setpoint<N>, TrajectoryError> {
    let request = message.heard.setpoint(&joint_names::<N>())?;
    // The reader has checked how many they are.
    let array = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
    Ok(Setpoint {
        position: array(&request.position),
        velocity: array(&request.velocity),
    })
}
